// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_join.h"
#include "common/status/fault_list.h"

namespace rigcal {

// The numbers an option takes: `low` to `high`, both included.
struct OptionRange {
  double low = 0;
  double high = 0;
  const char* unit = "";  // "Hz"
};
inline constexpr double kAboveZero = std::numeric_limits<double>::min();
inline constexpr double kNoLimit = std::numeric_limits<double>::max();

// One `key=value`, as typed or from a configuration file.
struct OptionText {
  enum class Type : uint8_t { kAny, kText, kNumber, kSwitch };  // kAny: typed, or of any type

  std::string key;
  std::string value;
  std::string where = {};  // "agent.toml:12"; empty: typed
  Type type = Type::kAny;

  friend bool operator==(const OptionText&, const OptionText&) = default;
};

// `KEY=VALUE` each. INVALID_ARGUMENT quotes every part that is none and every key given twice.
absl::StatusOr<std::vector<OptionText>> SplitOptions(const std::vector<std::string>& parts);

// An option as help shows it.
struct OptionHelp {
  std::string name;
  std::string values;         // "0 to 360 deg", "FILE"
  std::string default_value;  // empty: none
  std::string meaning;
};

// The options of one or several structs: each with its name, the member it sets, its values and its
// meaning. Command lines, configuration files, Validate() functions, formatters and help all go
// through such a table. It points into the structs, which outlive it; what they hold when an
// option is added is its default. Options added under one name are all set by it.
//
// An options struct has a function AddOptions(Struct*, OptionTable*); see ParseOptions,
// CheckOptions and FormatOptions below.
class OptionTable {
 public:
  using Reader = std::function<absl::Status(const std::string& value)>;
  using Formatter = std::function<std::string()>;

  // double, int, int64_t, uint32_t, size_t, or std::optional of double or int64_t.
  template <typename Number>
  void Add(std::string name, Number* value, OptionRange range, std::string meaning);
  void Add(std::string name, bool* value, std::string meaning);  // 0, 1, false, true
  // Several numbers with commas between them.
  void Add(std::string name, std::vector<double>* value, OptionRange range, std::string meaning);
  // One number for each camera, by index: "offset.2".
  void Add(std::string name, std::map<int, double>* value, OptionRange range, std::string meaning);
  // `values` for help: "NAME".
  void Add(std::string name, std::string* value, std::string values, std::string meaning);
  void AddPath(std::string name, std::string* value, std::string meaning);
  // `Member` is Value or std::optional<Value>.
  template <typename Member, typename Value>
  void AddChoice(std::string name, Member* value,
                 std::vector<std::pair<std::string, Value>> choices, std::string meaning);
  // Anything else. The status of `read` says what the value must be: "must be WIDTHxHEIGHT".
  void Add(std::string name, std::string values, std::string meaning, Reader read,
           Formatter format);

  bool Has(std::string_view name) const;
  bool IsPath(std::string_view name) const;
  std::vector<std::string> Names() const;
  std::vector<OptionHelp> Help() const;

  // Sets what is given and adds every fault: unknown names with the nearest known one, values that
  // cannot be read or are out of range, names given twice.
  void Read(const std::vector<OptionText>& given, FaultList* faults) const;
  // False: a fault was added.
  bool ReadOne(const OptionText& given, FaultList* faults) const;
  // Every value that differs from its default is read again and its faults added.
  void Check(FaultList* faults) const;
  // `key=value;...` of what differs from its default, or is among `always`.
  std::string Format(const std::vector<std::string>& always) const;

 private:
  // Key and value, as text.
  using Values = std::map<std::string, std::string>;
  struct Option {
    std::string name;
    std::string values;
    std::string meaning;
    OptionText::Type type;
    Reader read;
    Formatter format;
    std::map<int, double>* indexed = nullptr;  // of a family "offset.2", without read and format
    OptionRange range = {};                    // of a family
    bool is_path = false;
    Values defaults = {};

    Values Current() const;
    Values Changed() const;  // without what is as the default
  };

  void AddOption(Option option);

  std::vector<Option> options_;
};

absl::Status MustBeOneOf(const std::vector<std::string>& choices);

template <typename Member, typename Value>
void OptionTable::AddChoice(std::string name, Member* value,
                            std::vector<std::pair<std::string, Value>> choices,
                            std::string meaning) {
  std::vector<std::string> words;
  for (const auto& choice : choices) words.push_back(choice.first);
  Reader read = [=](const std::string& text) {
    for (const auto& [word, choice] : choices) {
      if (text != word) continue;
      *value = choice;
      return absl::OkStatus();
    }
    return MustBeOneOf(words);
  };
  Formatter format = [value, choices = std::move(choices)]() -> std::string {
    for (const auto& [word, choice] : choices) {
      if (*value == choice) return word;
    }
    return "";
  };
  Add(std::move(name), absl::StrJoin(words, "|"), std::move(meaning), std::move(read),
      std::move(format));
}

// The options of one struct from `key=value;key=value`. INVALID_ARGUMENT: `context`, then every
// fault, those of its Validate() included.
absl::StatusOr<std::vector<OptionText>> SplitOptionList(std::string_view text);

template <typename Options>
absl::StatusOr<Options> ParseOptions(const std::vector<OptionText>& given,
                                     std::string_view context) {
  Options options;
  OptionTable table;
  AddOptions(&options, &table);
  FaultList faults;
  table.Read(given, &faults);
  absl::Status status = faults.Result(context);
  if (status.ok()) status = options.Validate();
  if (!status.ok()) return status;
  return options;
}

// For Validate(): the faults of every option that is in the table.
template <typename Options>
void CheckOptions(const Options& options, FaultList* faults) {
  Options copy;
  OptionTable table;
  AddOptions(&copy, &table);
  copy = options;
  table.Check(faults);
}

// As OptionTable::Format.
template <typename Options>
std::string FormatOptions(const Options& options, const std::vector<std::string>& always = {}) {
  Options copy;
  OptionTable table;
  AddOptions(&copy, &table);
  copy = options;
  return table.Format(always);
}

}  // namespace rigcal
