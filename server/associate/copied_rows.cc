// SPDX-License-Identifier: Apache-2.0
#include "server/associate/copied_rows.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/statistics/robust_statistics.h"
#include "server/associate/shown_rows.h"

namespace rigcal::server {
namespace {

constexpr size_t kFewestCopies = 20;  // fewer may be chance, or no matter
constexpr double kCopiedShare = 0.1;
// Of all rows, by what they show: a copy is found in a part of them as well.
constexpr size_t kMostCompared = 1'000'000;

// A camera in one session, which may have several tracks.
struct SessionCamera {
  std::string name;
  std::vector<size_t> tracks;
};
using CamerasOfSession = std::map<std::string, std::vector<SessionCamera>>;

// Those that are needed come first.
CamerasOfSession BySession(const std::vector<CameraTrack>& tracks,
                           const std::function<bool(const std::string&)>& is_needed) {
  std::map<std::tuple<std::string, bool, std::string>, std::vector<size_t>> by_key;
  for (size_t t = 0; t < tracks.size(); ++t) {
    const std::string& name = tracks[t].camera.camera;
    by_key[{tracks[t].session_id, !is_needed(name), name}].push_back(t);
  }
  CamerasOfSession sessions;
  for (const auto& [key, own] : by_key) {
    sessions[std::get<0>(key)].push_back({std::get<2>(key), own});
  }
  return sessions;
}

struct Shown {
  uint64_t hash;
  size_t camera;  // of the session
  int64_t time_ns;
};

// The rows of a session's cameras, those that show the same beside each other.
std::vector<Shown> ShownRows(const std::vector<CameraTrack>& tracks,
                             const std::vector<SessionCamera>& cameras) {
  size_t count = 0;
  for (const SessionCamera& camera : cameras) {
    for (const size_t t : camera.tracks) count += tracks[t].observations.size();
  }
  const uint64_t stride = 1 + count / kMostCompared;
  std::vector<Shown> shown;
  for (size_t c = 0; c < cameras.size(); ++c) {
    for (const size_t t : cameras[c].tracks) {
      for (const Observation& row : tracks[t].observations) {
        const std::optional<uint64_t> hash = HashOfShown(row);
        if (hash && *hash % stride == 0) shown.push_back({*hash, c, row.time_ns});
      }
    }
  }
  std::ranges::sort(shown, {},
                    [](const Shown& row) { return std::tuple(row.hash, row.camera, row.time_ns); });
  return shown;
}

double SecondsBetween(int64_t from_ns, int64_t to_ns) {
  return 1e-9 * (static_cast<double>(to_ns) - static_cast<double>(from_ns));
}

// Two cameras of a session, and what they have in common.
struct Copy {
  size_t a = 0, b = 0;
  size_t count = 0;        // of common rows
  double later_s = 0;      // stamps of b minus those of a
  double tolerance_s = 0;  // of that
  double share_a = 0, share_b = 0;
};

double PeriodS(const std::vector<Shown>& rows, size_t camera) {
  std::vector<int64_t> times_ns;
  for (const Shown& row : rows) {
    if (row.camera == camera) times_ns.push_back(row.time_ns);
  }
  std::ranges::sort(times_ns);
  std::vector<double> steps_s;
  for (size_t i = 1; i < times_ns.size(); ++i) {
    const double step_s = SecondsBetween(times_ns[i - 1], times_ns[i]);
    if (step_s > 0) steps_s.push_back(step_s);
  }
  return steps_s.empty() ? 0 : UpperMedian(&steps_s);
}

// By second camera, the first one that it has its rows in common with.
std::vector<Copy> FindCopies(const std::vector<Shown>& shown, size_t camera_count) {
  std::vector<size_t> counts(camera_count, 0);
  // By second and first camera, how much later each common row is.
  std::map<std::pair<size_t, size_t>, std::vector<double>> pairs;
  for (size_t begin = 0; begin < shown.size();) {
    size_t end = begin;
    std::vector<Shown> once;  // of each camera that shows this once only
    while (end < shown.size() && shown[end].hash == shown[begin].hash) {
      size_t next = end;
      while (next < shown.size() && shown[next].hash == shown[end].hash &&
             shown[next].camera == shown[end].camera) {
        ++next;
      }
      counts[shown[end].camera] += next - end;
      if (next - end == 1) once.push_back(shown[end]);
      end = next;
    }
    for (size_t b = 1; b < once.size(); ++b) {
      for (size_t a = 0; a < b; ++a) {
        pairs[{once[b].camera, once[a].camera}].push_back(
            SecondsBetween(once[a].time_ns, once[b].time_ns));
      }
    }
    begin = end;
  }
  std::vector<Copy> copies;
  for (const auto& [pair, later_s] : pairs) {
    const auto& [b, a] = pair;
    if (!copies.empty() && copies.back().b == b) continue;
    if (later_s.size() < kFewestCopies) continue;
    Copy copy{.a = a, .b = b, .tolerance_s = 0.5 * PeriodS(shown, b)};
    std::vector<double> sorted_s = later_s;
    copy.later_s = UpperMedian(&sorted_s);
    copy.count = static_cast<size_t>(std::ranges::count_if(later_s, [&copy](double value_s) {
      return std::abs(value_s - copy.later_s) <= copy.tolerance_s;
    }));
    copy.share_a = static_cast<double>(copy.count) / static_cast<double>(counts[a]);
    copy.share_b = static_cast<double>(copy.count) / static_cast<double>(counts[b]);
    if (copy.count < kFewestCopies || std::max(copy.share_a, copy.share_b) < kCopiedShare) continue;
    copies.push_back(copy);
  }
  return copies;
}

// What a camera shows and when, sorted.
std::vector<std::pair<uint64_t, int64_t>> HashesOf(const std::vector<CameraTrack>& tracks,
                                                   const SessionCamera& camera) {
  std::vector<std::pair<uint64_t, int64_t>> all;
  for (const size_t t : camera.tracks) {
    for (const Observation& row : tracks[t].observations) {
      if (const auto hash = HashOfShown(row)) all.emplace_back(*hash, row.time_ns);
    }
  }
  std::ranges::sort(all);
  return all;
}

// Takes from `camera` the rows that another one, with `others`, has `later_s` before. How many.
size_t TakeCommon(const std::vector<std::pair<uint64_t, int64_t>>& others, double later_s,
                  double tolerance_s, const SessionCamera& camera,
                  std::vector<CameraTrack>* tracks) {
  const auto is_common = [&](const Observation& row) {
    const std::optional<uint64_t> hash = HashOfShown(row);
    if (!hash) return false;
    for (auto at =
             std::ranges::lower_bound(others, *hash, {}, &std::pair<uint64_t, int64_t>::first);
         at != others.end() && at->first == *hash; ++at) {
      if (std::abs(SecondsBetween(at->second, row.time_ns) - later_s) <= tolerance_s) return true;
    }
    return false;
  };
  size_t taken = 0;
  for (const size_t t : camera.tracks) {
    taken += std::erase_if((*tracks)[t].observations, is_common);
  }
  return taken;
}

size_t TakeAll(const SessionCamera& camera, std::vector<CameraTrack>* tracks) {
  size_t taken = 0;
  for (const size_t t : camera.tracks) {
    taken += (*tracks)[t].observations.size();
    (*tracks)[t].observations.clear();
  }
  return taken;
}

StampFault FaultOf(const std::string& session_id, const Copy& copy, const std::string& camera,
                   const std::string& other, bool is_b, bool is_whole) {
  const double share = is_b ? copy.share_b : copy.share_a;
  const double later_s = is_b ? copy.later_s : -copy.later_s;
  const std::string when = std::abs(later_s) > 1e-6
                               ? absl::StrFormat("stamped %.6g s %s", std::abs(later_s),
                                                 later_s > 0 ? "later" : "earlier")
                               : "at the same times";
  const auto views = static_cast<size_t>(std::llround(static_cast<double>(copy.count) / share));
  const std::string what =
      absl::StrCat("it has the same rows as ", other, ": ", copy.count, " of its ", views,
                   " wand views show the same pixels, ", when, ". ");
  return {
      StampFault::Kind::kCopied, session_id, camera, 100 * share,
      absl::StrCat(what, is_whole ? "One of the two files is a copy of the other's, and nothing "
                                    "says which: this camera was left out, and the rows of the "
                                    "other one may be of this camera. Export both again"
                                  : "These rows are of one of the two, and nothing says of which: "
                                    "they were left out of both. Look for files that were merged, "
                                    "and export both again")};
}

}  // namespace

std::vector<StampFault> UseCopiedRowsOnce(
    const std::function<bool(const std::string& camera)>& is_needed,
    std::vector<CameraTrack>* tracks, RefusalCounter* refused) {
  std::vector<StampFault> faults;
  for (const auto& [session_id, cameras] : BySession(*tracks, is_needed)) {
    const std::vector<Copy> copies = FindCopies(ShownRows(*tracks, cameras), cameras.size());
    std::vector<std::vector<std::pair<uint64_t, int64_t>>> hashes(cameras.size());
    std::set<size_t> whole;
    for (const Copy& copy : copies) {
      // The one that shares more, or the later one.
      const bool a_is_needed = is_needed(cameras[copy.a].name);
      const bool a_goes = copy.share_a > copy.share_b && !a_is_needed;
      const bool is_whole = 100 * (a_goes ? copy.share_a : copy.share_b) >= kWholeCopyPercent;
      const size_t gone = is_whole && a_goes ? copy.a : copy.b;
      const size_t other = gone == copy.b ? copy.a : copy.b;
      faults.push_back(FaultOf(session_id, copy, cameras[gone].name, cameras[other].name,
                               gone == copy.b, is_whole));
      if (is_whole) {
        whole.insert(gone);
        continue;
      }
      for (const size_t c : {copy.a, copy.b}) {
        if (hashes[c].empty()) hashes[c] = HashesOf(*tracks, cameras[c]);
      }
      for (const bool is_b : {false, true}) {
        const SessionCamera& camera = cameras[is_b ? copy.b : copy.a];
        const SessionCamera& from = cameras[is_b ? copy.a : copy.b];
        const size_t taken =
            TakeCommon(hashes[is_b ? copy.a : copy.b], is_b ? copy.later_s : -copy.later_s,
                       copy.tolerance_s, camera, tracks);
        refused->Add(camera.name, RefusalReason::kDuplicateEqual, taken,
                     absl::StrCat("the same pixels as rows of ", from.name));
      }
    }
    for (const size_t c : whole) {
      refused->Add(cameras[c].name, RefusalReason::kDuplicateEqual, TakeAll(cameras[c], tracks),
                   "its file has the same rows as another camera's");
    }
  }
  return faults;
}

}  // namespace rigcal::server
