// SPDX-License-Identifier: Apache-2.0
#include "client/net/unknown_id.h"

#include <algorithm>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"
#include "common/options/nearest_name.h"

namespace rigcal::client {
namespace {

constexpr size_t kMostListed = 8;
constexpr char kSession[] = "session";
constexpr char kCalibration[] = "calibration";

bool Holds(const std::vector<std::string>& ids, const std::string& id) {
  return std::ranges::find(ids, id) != ids.end();
}

std::string Listed(const std::vector<std::string>& ids) {
  const size_t shown = std::min(ids.size(), kMostListed);
  return absl::StrCat(absl::StrJoin(ids.begin(), ids.begin() + static_cast<ptrdiff_t>(shown), ", "),
                      ids.size() > shown ? absl::StrCat(" and ", ids.size() - shown, " more") : "");
}

// Words that people type for the last one.
bool MeansNewest(const std::string& id) { return id == "newest" || id == "latest" || id == "last"; }

}  // namespace

UnknownId ParseUnknownId(const std::string& message) {
  absl::string_view text = message;
  if (!absl::ConsumePrefix(&text, "no ")) return {};
  for (const char* const kind : {kSession, kCalibration}) {
    absl::string_view id = text;
    if (!absl::ConsumePrefix(&id, kind) || !absl::ConsumePrefix(&id, " ")) continue;
    if (id.empty() || id.find(' ') != absl::string_view::npos) return {};
    return {.kind = kind, .id = std::string(id)};
  }
  return {};
}

std::string DescribeUnknownId(const UnknownId& unknown, const KnownIds& known) {
  const auto& [kind, id] = unknown;
  const bool is_session = kind == kSession;
  const std::vector<std::string>& ids = is_session ? known.sessions : known.calibrations;
  const std::string begin = absl::StrCat("no ", kind, " ", id);
  if (is_session && Holds(known.calibrations, id)) {
    return absl::StrCat(begin, ": ", id, " is a calibration; see rigcal calibration get ", id);
  }
  if (!is_session && Holds(known.sessions, id)) {
    return absl::StrCat(begin, ": ", id, " is a session; see rigcal session get ", id,
                        ", or its calibrations: rigcal calibration list --session ", id);
  }
  if (ids.empty()) {
    return absl::StrCat(
        begin, "; there is none at all: ",
        is_session ? "rigcal session create makes one" : "rigcal calibrate SESSION makes one");
  }
  if (MeansNewest(id)) return absl::StrCat(begin, "; the newest one is ", ids.front());
  std::vector<std::string> longer;
  std::ranges::copy_if(ids, std::back_inserter(longer),
                       [&](const std::string& each) { return each.starts_with(id); });
  if (!longer.empty()) {
    return absl::StrCat(begin, "; an id is typed in full, and it may be the beginning of ",
                        Listed(longer));
  }
  const std::string nearest = NearestName(id, ids);
  if (!nearest.empty() && nearest != ids.front()) {
    return absl::StrCat(begin, "; did you mean ", nearest, "? The newest one is ", ids.front());
  }
  if (!nearest.empty()) return absl::StrCat(begin, "; did you mean ", nearest, "?");
  return absl::StrCat(begin, "; there is ", Listed(ids), ids.size() > 1 ? " (newest first)" : "");
}

}  // namespace rigcal::client
