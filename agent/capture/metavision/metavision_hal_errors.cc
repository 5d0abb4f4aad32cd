// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/metavision/metavision_hal_errors.h"

#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"

namespace rigcal::agent {

absl::Status MetavisionFailure(std::string_view what, std::string_view why) {
  std::vector<std::string> lines;
  for (const auto line : absl::StrSplit(std::string(why), '\n')) {
    const std::string text(absl::StripAsciiWhitespace(line));
    if (text.find_first_not_of('-') != text.npos) lines.push_back(text);
  }
  return absl::UnavailableError(absl::StrCat(std::string(what), ": ", absl::StrJoin(lines, " ")));
}

}  // namespace rigcal::agent
