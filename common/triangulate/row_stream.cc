// SPDX-License-Identifier: Apache-2.0
#include "common/triangulate/row_stream.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/fault_list.h"
#include "common/triangulate/marker_track.h"

namespace rigcal {
namespace {

constexpr int64_t kLongAgoNs = std::numeric_limits<int64_t>::min() / 4;
// Rows on both sides of a block, by which its rows are moved (marker_track.cc): 2.5 periods or
// 45 ms, and an instant of cameras that run freely is a period wide.
constexpr double kMarginPeriods = 4, kLeastMarginS = 0.06;
// Behind a block more is kept, so that what is far from its neighbours is told there as well.
constexpr double kContextMargins = 4;
constexpr double kMinBlockS = 0.1, kMaxBlockS = 5, kMaxDelayS = 60;
constexpr size_t kPeriodRows = 64;  // whose median step is a camera's period

int64_t StreamNs(double seconds) { return std::llround(1e9 * seconds); }

}  // namespace

absl::Status RowStreamOptions::Validate() const {
  FaultList faults;
  if (!(block_s >= kMinBlockS && block_s <= kMaxBlockS)) {
    faults.Add("block_s is ", block_s, ", it must be from ", kMinBlockS, " to ", kMaxBlockS);
  }
  if (!(max_delay_s > 0 && max_delay_s <= kMaxDelayS)) {
    faults.Add("max_delay_s is ", max_delay_s, ", it must be above 0 and at most ", kMaxDelayS);
  }
  if (!(triangulation.sigma_px >= 0 && triangulation.sigma_px <= 100)) {
    faults.Add("sigma_px is ", triangulation.sigma_px, ", it must be from 0 to 100");
  }
  if (!(triangulation.max_sigmas >= 1 && triangulation.max_sigmas <= 1e6)) {
    faults.Add("max_sigmas is ", triangulation.max_sigmas, ", it must be from 1 to 1000000");
  }
  if (!(triangulation.diameter_m >= 0 && triangulation.diameter_m <= 10)) {
    faults.Add("diameter_m is ", triangulation.diameter_m, ", it must be from 0 to 10");
  }
  return faults.Result();
}

RowStream::RowStream(CalibrationResult calibration, RowStreamOptions options)
    : calibration_(std::move(calibration)), options_(std::move(options)), from_ns_(kLongAgoNs) {}

absl::StatusOr<RowStream> RowStream::Create(CalibrationResult calibration,
                                            RowStreamOptions options) {
  if (const absl::Status status = options.Validate(); !status.ok()) return status;
  if (!calibration.scale_known) {
    return absl::FailedPreconditionError(
        "the scale of the calibration is not known: its points have no place in metres");
  }
  RowStream stream(std::move(calibration), std::move(options));
  std::vector<std::string> names;
  for (size_t c = 0; c < stream.calibration_.cameras.size(); ++c) {
    const std::string& name = stream.calibration_.cameras[c].camera;
    names.push_back(name);
    const std::vector<std::string>& asked = stream.options_.cameras;
    if (!asked.empty() && std::ranges::find(asked, name) == asked.end()) continue;
    stream.tracks_[name].camera = c;
  }
  for (const std::string& name : stream.options_.cameras) {
    if (stream.tracks_.contains(name)) continue;
    return absl::InvalidArgumentError(absl::StrCat("the calibration has no camera ", name,
                                                   "; it has ", absl::StrJoin(names, ", ")));
  }
  if (stream.tracks_.size() < 2) {
    return absl::InvalidArgumentError(
        "points are triangulated from two cameras at least; name two or none");
  }
  return stream;
}

int64_t RowStream::RigTimeOf(const Track& track, const Observation& row) const {
  return RigTimeNs(calibration_.cameras[track.camera], row.time_ns);
}

absl::Status RowStream::Add(const std::string& camera, const std::vector<Observation>& rows) {
  const auto found = tracks_.find(camera);
  if (found == tracks_.end()) {
    std::vector<std::string> names;
    for (const auto& [name, track] : tracks_) names.push_back(name);
    return absl::InvalidArgumentError(
        absl::StrCat("camera ", camera, " is none of this stream: ", absl::StrJoin(names, ", ")));
  }
  Track& track = found->second;
  for (const Observation& row : rows) {
    if (row.markers.empty() || row.markers.size() > kMaxStreamMarkers ||
        (marker_count_ != 0 && row.markers.size() != marker_count_)) {
      return absl::InvalidArgumentError(
          absl::StrCat("a row of camera ", camera, " has ", row.markers.size(), " markers; ",
                       marker_count_ == 0 ? absl::StrCat("1 to ", kMaxStreamMarkers, " are allowed")
                                          : absl::StrCat("the rows before had ", marker_count_)));
    }
    marker_count_ = row.markers.size();
    const int64_t time_ns = RigTimeOf(track, row);
    if (time_ns < from_ns_ || (track.has_rows && time_ns <= track.last_ns)) {
      ++late_row_count_;
      continue;
    }
    track.rows.push_back(row);
    track.last_ns = time_ns;
    track.has_rows = true;
  }
  if (waiting_row_count() > options_.max_rows) {
    return absl::ResourceExhaustedError(
        absl::StrCat("more than ", options_.max_rows,
                     " rows wait for those of other cameras; send the rows of all cameras in the "
                     "order of time"));
  }
  return absl::OkStatus();
}

size_t RowStream::waiting_row_count() const {
  size_t count = 0;
  for (const auto& [name, track] : tracks_) count += track.rows.size();
  return count;
}

double RowStream::LongestPeriodS() const {
  double longest_s = 0;
  for (const auto& [name, track] : tracks_) {
    std::vector<int64_t> steps_ns;
    const size_t begin = track.rows.size() > kPeriodRows ? track.rows.size() - kPeriodRows : 0;
    for (size_t i = begin + 1; i < track.rows.size(); ++i) {
      steps_ns.push_back(track.rows[i].time_ns - track.rows[i - 1].time_ns);
    }
    if (steps_ns.empty()) continue;
    longest_s = std::max(longest_s, 1e-9 * static_cast<double>(UpperMedian(&steps_ns)));
  }
  return longest_s;
}

int64_t RowStream::HorizonNs() const {
  int64_t newest_ns = kLongAgoNs, oldest_ns = std::numeric_limits<int64_t>::max();
  for (const auto& [name, track] : tracks_) {
    const int64_t last_ns = track.has_rows ? track.last_ns : kLongAgoNs;
    newest_ns = std::max(newest_ns, last_ns);
    oldest_ns = std::min(oldest_ns, last_ns);
  }
  if (newest_ns == kLongAgoNs) return kLongAgoNs;
  return std::max(oldest_ns, newest_ns - StreamNs(options_.max_delay_s));
}

void RowStream::ForgetBefore(int64_t rig_time_ns) {
  for (auto& [name, track] : tracks_) {
    const auto first = std::ranges::find_if(
        track.rows, [&](const Observation& row) { return RigTimeOf(track, row) >= rig_time_ns; });
    track.rows.erase(track.rows.begin(), first);
  }
}

absl::StatusOr<Triangulation> RowStream::Take(bool end) {
  // A camera's pause must not make its period: no margin is longer than what is waited for.
  const double margin_s =
      std::min(std::max(kLeastMarginS, kMarginPeriods * LongestPeriodS()), options_.max_delay_s);
  const int64_t until_ns =
      end ? std::numeric_limits<int64_t>::max() : HorizonNs() - StreamNs(margin_s);
  if (!end) {
    int64_t first_ns = std::numeric_limits<int64_t>::max();
    for (const auto& [name, track] : tracks_) {
      for (const Observation& row : track.rows) {
        const int64_t time_ns = RigTimeOf(track, row);
        if (time_ns < from_ns_) continue;
        first_ns = std::min(first_ns, time_ns);
        break;
      }
    }
    if (first_ns > until_ns || until_ns - first_ns < StreamNs(options_.block_s)) {
      return Triangulation();
    }
  }
  std::vector<CameraRows> rows;
  for (const auto& [name, track] : tracks_) {
    if (!track.rows.empty()) rows.push_back({name, track.rows});
  }
  Triangulation points;
  if (rows.size() >= 2) {
    TriangulationOptions options = options_.triangulation;
    options.from_ns = from_ns_;
    options.until_ns = until_ns;
    absl::StatusOr<Triangulation> made = TriangulateRows(calibration_, std::move(rows), options);
    if (!made.ok()) return made.status();
    points = *std::move(made);
  }
  if (end) {
    for (auto& [name, track] : tracks_) track.rows.clear();
    return points;
  }
  from_ns_ = std::max(until_ns, points.last_row_ns) + 1;
  ForgetBefore(from_ns_ - StreamNs(kContextMargins * margin_s));
  return points;
}

}  // namespace rigcal
