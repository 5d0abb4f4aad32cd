// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/world/option_table.h"

#include <cmath>
#include <set>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_split.h"
#include "common/status/status_macros.h"

namespace rigcal {

absl::Status RefuseOption(const OptionNotation& notation, std::string_view part,
                          std::string_view why) {
  return absl::InvalidArgumentError(absl::StrCat(notation.kind, " \"",
                                                 absl::CHexEscape(std::string(part.substr(0, 100))),
                                                 "\" ", std::string(why)));
}

absl::Status ForEachOptionPart(const OptionNotation& notation, std::string_view text,
                               const std::function<absl::Status(const OptionPart&)>& take) {
  std::set<std::string> seen;
  for (absl::string_view piece : absl::StrSplit(absl::string_view(text.data(), text.size()), ';')) {
    const std::string part(absl::StripAsciiWhitespace(piece));
    if (part.empty()) continue;
    const size_t equals = part.find('=');
    if (!seen.insert(part.substr(0, equals)).second) {
      return RefuseOption(notation, part, "is given twice");
    }
    if (equals == std::string::npos) {
      return RefuseOption(notation, part,
                          absl::StrCat("has no value, as ", notation.example, " has one"));
    }
    RIGCAL_RETURN_IF_ERROR(take({part, part.substr(0, equals), part.substr(equals + 1)}));
  }
  return absl::OkStatus();
}

absl::Status ParseOption(const OptionNotation& notation, const OptionPart& part, double* value) {
  double number = 0;
  if (!absl::SimpleAtod(part.value, &number) || !std::isfinite(number)) {
    return RefuseOption(notation, part.text, "needs a finite number");
  }
  *value = number;
  return absl::OkStatus();
}

absl::Status ParseOption(const OptionNotation& notation, const OptionPart& part, bool* value) {
  if (part.value != "0" && part.value != "1") {
    return RefuseOption(notation, part.text, "must be 0 or 1");
  }
  *value = part.value == "1";
  return absl::OkStatus();
}

absl::Status ParseOption(const OptionNotation& notation, const OptionPart& part, uint32_t* value) {
  uint32_t whole = 0;
  if (!absl::SimpleAtoi(part.value, &whole)) {
    return RefuseOption(notation, part.text, "needs a whole number, 0 to 4294967295");
  }
  *value = whole;
  return absl::OkStatus();
}

}  // namespace rigcal
