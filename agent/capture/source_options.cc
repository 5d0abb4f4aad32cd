// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/source_options.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "agent/capture/pacer.h"

namespace rigcal::agent {
namespace {

constexpr double kMaxFactor = 1e6;

std::string Place(const SourceOption& option) {
  return option.where.empty() ? "" : absl::StrCat(option.where, ": ");
}

}  // namespace

SourceOptions::SourceOptions(std::vector<SourceOption> options) : options_(std::move(options)) {}

absl::StatusOr<SourceOptions> SourceOptions::Split(const std::vector<std::string>& texts) {
  std::vector<SourceOption> options;
  for (const std::string& text : texts) {
    const std::pair<std::string, std::string> pair = absl::StrSplit(text, absl::MaxSplits('=', 1));
    if (pair.first.empty() || pair.second.empty()) {
      return absl::InvalidArgumentError(absl::StrCat("part \"", text, "\" is not KEY=VALUE"));
    }
    for (const SourceOption& earlier : options) {
      if (earlier.key == pair.first) {
        return absl::InvalidArgumentError(absl::StrCat(pair.first, " is given twice"));
      }
    }
    options.push_back({.key = pair.first, .value = pair.second, .where = ""});
  }
  return SourceOptions(std::move(options));
}

void SourceOptions::Override(SourceOption option) {
  std::erase_if(options_, [&](const SourceOption& old) { return old.key == option.key; });
  options_.push_back(std::move(option));
}

bool SourceOptions::Has(std::string_view key) const {
  return std::any_of(options_.begin(), options_.end(),
                     [&](const SourceOption& option) { return option.key == key; });
}

const SourceOption* SourceOptions::Find(std::string_view key) {
  taken_.emplace(key);
  for (const SourceOption& option : options_) {
    if (option.key == key) return &option;
  }
  return nullptr;
}

void SourceOptions::AddFault(std::string_view key, const std::string& what) {
  const SourceOption* option = Find(key);
  if (option == nullptr) {
    faults_.push_back(absl::StrCat(std::string(key), " ", what));
  } else {
    faults_.push_back(absl::StrCat(Place(*option), option->key, "=", option->value, " ", what));
  }
}

void SourceOptions::Take(std::string_view key, std::string_view meaning, double low, double high,
                         double* value) {
  const SourceOption* option = Find(key);
  if (option == nullptr) return;
  double number = 0;
  if (absl::SimpleAtod(option->value, &number) && number >= low && number <= high) {
    *value = number;
    return;
  }
  AddFault(key, absl::StrCat("is not ", std::string(meaning)));
}

void SourceOptions::Take(std::string_view key, std::string_view meaning, double low, double high,
                         std::optional<double>* value) {
  if (Find(key) == nullptr) return;
  double number = 0;
  Take(key, meaning, low, high, &number);
  *value = number;
}

void SourceOptions::Take(std::string_view key, std::string_view meaning, int low, int high,
                         int* value) {
  const SourceOption* option = Find(key);
  if (option == nullptr) return;
  int number = 0;
  if (absl::SimpleAtoi(option->value, &number) && number >= low && number <= high) {
    *value = number;
    return;
  }
  AddFault(key, absl::StrCat("is not ", std::string(meaning)));
}

void SourceOptions::Take(std::string_view key, bool* value) {
  const SourceOption* option = Find(key);
  if (option == nullptr) return;
  const std::string& text = option->value;
  if (text == "0" || text == "1" || text == "false" || text == "true") {
    *value = text == "1" || text == "true";
    return;
  }
  AddFault(key, "is neither 0 nor 1");
}

void SourceOptions::Take(std::string_view key, std::string* value) {
  if (const SourceOption* option = Find(key)) *value = option->value;
}

void SourceOptions::TakeSpeed(double* speed) {
  const SourceOption* option = Find("speed");
  if (option == nullptr) return;
  if (const absl::StatusOr<double> parsed = ParseSpeed(option->value); parsed.ok()) {
    *speed = *parsed;
  } else {
    faults_.push_back(absl::StrCat(Place(*option), std::string(parsed.status().message())));
  }
}

std::vector<SourceOption> SourceOptions::TakeRest() {
  std::vector<SourceOption> rest;
  for (const SourceOption& option : options_) {
    if (taken_.insert(option.key).second) rest.push_back(option);
  }
  return rest;
}

absl::Status SourceOptions::Finish() const {
  std::vector<std::string> faults = faults_;
  for (const SourceOption& option : options_) {
    if (taken_.contains(option.key)) continue;
    faults.push_back(absl::StrCat(Place(option), "part \"", option.key,
                                  "\" is not known (known: ", absl::StrJoin(taken_, ", "), ")"));
  }
  if (faults.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrJoin(faults, "; "));
}

absl::StatusOr<double> ParseSpeed(std::string_view text) {
  if (text == "max") return kMaxSpeed;
  double factor = 0;
  if (!absl::SimpleAtod(std::string(text), &factor) || !std::isfinite(factor) || factor <= 0 ||
      factor > kMaxFactor) {
    return absl::InvalidArgumentError(
        absl::StrCat("speed=", std::string(text), " is neither max nor a factor above 0"));
  }
  return factor;
}

}  // namespace rigcal::agent
