// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "common/status/fault_list.h"
#include "common/status/status_macros.h"
#include "common/text/shortest_text.h"

namespace rigcal {

// The notation of options structs, `name=value;name=value`.

// How the messages about one struct's notation begin, and a part that is right.
struct OptionNotation {
  const char* kind;     // "picture option"
  const char* example;  // "lux=200"
};

struct OptionPart {
  std::string text;  // "lux=200"
  std::string name;
  std::string value;
};

// INVALID_ARGUMENT that quotes the part.
absl::Status RefuseOption(const OptionNotation& notation, std::string_view part,
                          std::string_view why);
// Calls `take` with each part in order and returns its first error. INVALID_ARGUMENT for a part
// without a value and for a name that was there before.
absl::Status ForEachOptionPart(const OptionNotation& notation, std::string_view text,
                               const std::function<absl::Status(const OptionPart&)>& take);
// INVALID_ARGUMENT for what is no finite number, is neither 0 nor 1, or is no whole number of 32
// bits; `value` is left alone then.
absl::Status ParseOption(const OptionNotation& notation, const OptionPart& part, double* value);
absl::Status ParseOption(const OptionNotation& notation, const OptionPart& part, bool* value);
absl::Status ParseOption(const OptionNotation& notation, const OptionPart& part, uint32_t* value);

template <typename Options>
struct NumberOption {
  const char* name;
  double Options::*member;
  double low;
  double high;
  const char* unit = "";  // in messages, such as " s"
};

template <typename Options>
struct SwitchOption {
  const char* name;
  bool Options::*member;
};

// The numbers and switches of a struct that has a `seed` besides.
template <typename Options>
struct OptionTable {
  OptionNotation notation;
  std::span<const NumberOption<Options>> numbers;
  std::span<const SwitchOption<Options>> switches;

  bool Has(std::string_view name) const {
    if (name == "seed") return true;
    for (const auto& option : numbers) {
      if (name == option.name) return true;
    }
    for (const auto& option : switches) {
      if (name == option.name) return true;
    }
    return false;
  }

  // All names with ", " between them.
  std::string Names() const {
    std::string names = "seed";
    for (const auto& option : numbers) absl::StrAppend(&names, ", ", option.name);
    for (const auto& option : switches) absl::StrAppend(&names, ", ", option.name);
    return names;
  }

  // INVALID_ARGUMENT for a name that the table does not have (`known` are listed) and for a value
  // that cannot be read. Whether a number is in its range is for Check.
  absl::Status Take(const OptionPart& part, std::string_view known, Options* options) const {
    if (part.name == "seed") return ParseOption(notation, part, &options->seed);
    for (const auto& option : numbers) {
      if (part.name == option.name) return ParseOption(notation, part, &(options->*option.member));
    }
    for (const auto& option : switches) {
      if (part.name == option.name) return ParseOption(notation, part, &(options->*option.member));
    }
    return RefuseOption(notation, part.text,
                        absl::StrCat("is unknown, known are ", std::string(known)));
  }

  void Check(const Options& options, FaultList* faults) const {
    for (const auto& option : numbers) {
      faults->CheckRange(option.name, options.*option.member, option.low, option.high, option.unit);
    }
  }

  // Where the table is all there is. INVALID_ARGUMENT also for what Validate() refuses.
  absl::StatusOr<Options> Parse(std::string_view text) const {
    Options options;
    const std::string known = Names();
    RIGCAL_RETURN_IF_ERROR(ForEachOptionPart(
        notation, text, [&](const OptionPart& part) { return Take(part, known, &options); }));
    RIGCAL_RETURN_IF_ERROR(options.Validate());
    return options;
  }

  // The parts that differ from their defaults, the seed first.
  std::vector<std::string> Format(const Options& options) const {
    const Options defaults;
    std::vector<std::string> parts;
    if (options.seed != defaults.seed) parts.push_back(absl::StrCat("seed=", options.seed));
    for (const auto& option : numbers) {
      const double value = options.*option.member;
      if (value == defaults.*option.member) continue;
      parts.push_back(absl::StrCat(option.name, "=", ShortestText(value)));
    }
    for (const auto& option : switches) {
      if (options.*option.member) parts.push_back(absl::StrCat(option.name, "=1"));
    }
    return parts;
  }
};

}  // namespace rigcal
