// SPDX-License-Identifier: Apache-2.0
#include "common/options/option_table.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <type_traits>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/options/nearest_name.h"
#include "common/status/status_macros.h"
#include "common/text/shortest_text.h"

namespace rigcal {
namespace {

std::string RangeText(const OptionRange& range) {
  const std::string unit = *range.unit == '\0' ? "" : absl::StrCat(" ", range.unit);
  if (range.low == kAboveZero) {
    return range.high == kNoLimit
               ? absl::StrCat("above 0", unit)
               : absl::StrCat("above 0, at most ", ShortestText(range.high), unit);
  }
  return absl::StrCat(ShortestText(range.low), " to ", ShortestText(range.high), unit);
}

template <typename Number>
absl::Status ReadNumber(const std::string& text, const OptionRange& range, Number* value) {
  constexpr bool kIsWhole = std::is_integral_v<Number>;
  std::conditional_t<kIsWhole, int64_t, double> number = 0;
  bool is_number = false;
  if constexpr (kIsWhole) {
    is_number = absl::SimpleAtoi(text, &number);
  } else {
    is_number = absl::SimpleAtod(text, &number) && std::isfinite(number);
  }
  const auto real = static_cast<double>(number);
  if (!is_number || real < range.low || real > range.high) {
    const bool is_open = range.low == kAboveZero;
    return absl::InvalidArgumentError(absl::StrCat("must be a ", kIsWhole ? "whole " : "", "number",
                                                   is_open ? " " : " of ", RangeText(range)));
  }
  *value = static_cast<Number>(number);
  return absl::OkStatus();
}

template <typename Number>
absl::Status ReadNumber(const std::string& text, const OptionRange& range,
                        std::optional<Number>* value) {
  Number number = 0;
  absl::Status status = ReadNumber(text, range, &number);
  if (status.ok()) *value = number;
  return status;
}

std::string TextOf(double value) { return ShortestText(value); }
template <typename Whole>
std::string TextOf(Whole value) {
  return absl::StrCat(value);
}
template <typename Number>
std::string TextOf(const std::optional<Number>& value) {
  return value ? TextOf(*value) : "";
}

}  // namespace

absl::Status MustBeOneOf(const std::vector<std::string>& choices) {
  const std::vector<std::string> first(choices.begin(), choices.end() - 1);
  return absl::InvalidArgumentError(
      absl::StrCat("must be ", absl::StrJoin(first, ", "), " or ", choices.back()));
}

absl::StatusOr<std::vector<OptionText>> SplitOptions(const std::vector<std::string>& parts) {
  std::vector<OptionText> options;
  FaultList faults;
  std::set<std::string> seen;
  for (const std::string& part : parts) {
    const std::pair<std::string, std::string> pair = absl::StrSplit(part, absl::MaxSplits('=', 1));
    if (!pair.first.empty() && !seen.insert(pair.first).second) {
      faults.Add(Shown(pair.first), " is given twice");
    } else if (pair.first.empty() || pair.second.empty()) {
      faults.Add("\"", Shown(part), "\" is not KEY=VALUE");
    } else {
      options.push_back({.key = pair.first, .value = pair.second});
    }
  }
  RIGCAL_RETURN_IF_ERROR(faults.Result());
  return options;
}

absl::StatusOr<std::vector<OptionText>> SplitOptionList(std::string_view text) {
  std::vector<std::string> parts;
  for (const auto part : absl::StrSplit(std::string(text), ';', absl::SkipWhitespace())) {
    parts.emplace_back(absl::StripAsciiWhitespace(part));
  }
  return SplitOptions(parts);
}

OptionTable::Values OptionTable::Option::Current() const {
  if (indexed == nullptr) return {{name, format()}};
  Values texts;
  for (const auto& [index, number] : *indexed) {
    texts[absl::StrCat(name, ".", index)] = ShortestText(number);
  }
  return texts;
}

OptionTable::Values OptionTable::Option::Changed() const {
  Values texts = Current();
  std::erase_if(texts, [&](const auto& text) {
    const auto standard = defaults.find(text.first);
    return standard != defaults.end() && standard->second == text.second;
  });
  return texts;
}

void OptionTable::AddOption(Option option) {
  option.defaults = option.Current();
  options_.push_back(std::move(option));
}

template <typename Number>
void OptionTable::Add(std::string name, Number* value, OptionRange range, std::string meaning) {
  AddOption({std::move(name), RangeText(range), std::move(meaning), OptionText::Type::kNumber,
             [=](const std::string& text) { return ReadNumber(text, range, value); },
             [=] { return TextOf(*value); }});
}

template void OptionTable::Add(std::string, double*, OptionRange, std::string);
template void OptionTable::Add(std::string, int*, OptionRange, std::string);
template void OptionTable::Add(std::string, int64_t*, OptionRange, std::string);
template void OptionTable::Add(std::string, uint32_t*, OptionRange, std::string);
template void OptionTable::Add(std::string, size_t*, OptionRange, std::string);
template void OptionTable::Add(std::string, std::optional<double>*, OptionRange, std::string);
template void OptionTable::Add(std::string, std::optional<int64_t>*, OptionRange, std::string);

void OptionTable::Add(std::string name, bool* value, std::string meaning) {
  const auto read = [=](const std::string& text) {
    const bool is_true = text == "1" || text == "true";
    if (!is_true && text != "0" && text != "false") {
      return absl::InvalidArgumentError("must be 0 or 1");
    }
    *value = is_true;
    return absl::OkStatus();
  };
  AddOption({std::move(name), "0|1", std::move(meaning), OptionText::Type::kSwitch, read,
             [=] { return *value ? "1" : "0"; }});
}

void OptionTable::Add(std::string name, std::vector<double>* value, OptionRange range,
                      std::string meaning) {
  const auto read = [=](const std::string& text) {
    std::vector<double> numbers;
    for (const auto word : absl::StrSplit(text, ',')) {
      const std::string item(absl::StripAsciiWhitespace(word));
      absl::Status status = ReadNumber(item, range, &numbers.emplace_back());
      if (!status.ok()) return status;
    }
    *value = std::move(numbers);
    return absl::OkStatus();
  };
  const auto format = [=] {
    return absl::StrJoin(
        *value, ",", [](std::string* out, double number) { out->append(ShortestText(number)); });
  };
  Add(std::move(name), absl::StrCat(RangeText(range), ", or several: A,B,..."), std::move(meaning),
      read, format);
}

void OptionTable::Add(std::string name, std::map<int, double>* value, OptionRange range,
                      std::string meaning) {
  AddOption({std::move(name), RangeText(range), std::move(meaning), OptionText::Type::kNumber,
             /*read=*/nullptr, /*format=*/nullptr, value, range});
}

void OptionTable::Add(std::string name, std::string* value, std::string values,
                      std::string meaning) {
  const auto read = [=](const std::string& text) {
    *value = text;
    return absl::OkStatus();
  };
  Add(std::move(name), std::move(values), std::move(meaning), read, [=] { return *value; });
}

void OptionTable::AddPath(std::string name, std::string* value, std::string meaning) {
  Add(std::move(name), value, "FILE", std::move(meaning));
  options_.back().is_path = true;
}

void OptionTable::Add(std::string name, std::string values, std::string meaning, Reader read,
                      Formatter format) {
  AddOption({std::move(name), std::move(values), std::move(meaning), OptionText::Type::kText,
             std::move(read), std::move(format)});
}

bool OptionTable::Has(std::string_view name) const {
  return std::ranges::find(options_, name, &Option::name) != options_.end();
}

bool OptionTable::IsPath(std::string_view name) const {
  return std::ranges::any_of(
      options_, [&](const Option& option) { return option.name == name && option.is_path; });
}

std::vector<OptionHelp> OptionTable::Help() const {
  std::vector<OptionHelp> help;
  for (const Option& option : options_) {
    const bool is_family = option.indexed != nullptr;
    const std::string name = is_family ? option.name + ".N" : option.name;
    if (std::ranges::find(help, name, &OptionHelp::name) != help.end()) continue;
    // Where a value must be above 0, 0 stands for "not given".
    const bool is_unset = option.values.starts_with("above 0") && option.Current()[name] == "0";
    help.push_back({.name = name,
                    .values = option.values,
                    .default_value = is_family || is_unset ? "" : option.defaults.at(name),
                    .meaning = option.meaning});
  }
  return help;
}

std::vector<std::string> OptionTable::Names() const {
  std::vector<std::string> names;
  for (const OptionHelp& option : Help()) names.push_back(option.name);
  return names;
}

bool OptionTable::ReadOne(const OptionText& given, FaultList* faults) const {
  const std::string place = given.where.empty() ? "" : absl::StrCat(given.where, ": ");
  const auto refuse = [&](std::string_view why) {
    faults->Add(place, Shown(given.key), "=", Shown(given.value), " ", std::string(why));
    return false;
  };
  const size_t dot = given.key.find('.');
  bool is_known = false;
  for (const Option& option : options_) {
    const bool is_family = option.indexed != nullptr;
    if (is_family != (dot != given.key.npos) || option.name != given.key.substr(0, dot)) continue;
    is_known = true;
    int index = 0;
    if (is_family && (!absl::SimpleAtoi(given.key.substr(dot + 1), &index) || index < 0)) {
      return refuse(absl::StrCat("must name a camera by its index, such as ", option.name, ".2"));
    }
    if (given.type != OptionText::Type::kAny && given.type != option.type) {
      return refuse(option.type == OptionText::Type::kText     ? "must be text in quotes"
                    : option.type == OptionText::Type::kNumber ? "must be a number"
                                                               : "must be true or false");
    }
    const absl::Status status =
        is_family ? ReadNumber(given.value, option.range, &(*option.indexed)[index])
                  : option.read(given.value);
    if (!status.ok()) return refuse(std::string(status.message()));
  }
  if (!is_known) faults->Add(place, UnknownName("option", given.key, Names()));
  return is_known;
}

void OptionTable::Read(const std::vector<OptionText>& given, FaultList* faults) const {
  std::set<std::string> seen;
  for (const OptionText& option : given) {
    if (!seen.insert(option.key).second) {
      faults->Add(Shown(option.key), " is given twice");
    } else {
      ReadOne(option, faults);
    }
  }
}

void OptionTable::Check(FaultList* faults) const {
  for (const Option& option : options_) {
    for (const auto& [key, text] : option.Changed()) ReadOne({.key = key, .value = text}, faults);
  }
}

std::string OptionTable::Format(const std::vector<std::string>& always) const {
  std::vector<std::string> parts;
  for (const Option& option : options_) {
    const bool is_shown = std::ranges::find(always, option.name) != always.end();
    for (const auto& [key, text] : is_shown ? option.Current() : option.Changed()) {
      parts.push_back(absl::StrCat(key, "=", text));
    }
  }
  return absl::StrJoin(parts, ";");
}

}  // namespace rigcal
