// SPDX-License-Identifier: Apache-2.0
#include "server/session/incomplete_session.h"

#include <algorithm>
#include <iterator>
#include <set>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace rigcal::server {
namespace {

// What is missing of one camera, over all sessions.
struct MissingRows {
  uint64_t detected = 0, read = 0, damaged = 0, late = 0;
  double share = 0;      // at least
  bool is_open = false;  // nobody knows whether it is more
  std::set<std::string> sessions;

  uint64_t count() const { return detected > read ? detected - read : 0; }
};

std::map<std::string, MissingRows> MissingByCamera(absl::Span<const RowShare> all,
                                                   const CalibrationOptions& options) {
  std::vector<RowShare> shares;
  std::ranges::copy_if(all, std::back_inserter(shares), [&options](const RowShare& share) {
    return std::ranges::count(options.without_cameras, share.camera()) == 0 &&
           std::ranges::count(options.without_sessions, share.session_id()) == 0;
  });
  std::map<std::string_view, double> longest_s;  // by session
  for (const RowShare& share : shares) {
    double& longest = longest_s[share.session_id()];
    longest = std::max(longest, share.span_s());
  }
  std::map<std::string, MissingRows> missing;
  for (const RowShare& share : shares) {
    MissingRows& camera = missing[share.camera()];
    camera.detected += share.detected();
    camera.read += share.read();
    camera.damaged += share.damaged();
    camera.late += share.late();
    if (share.detected() > share.read() || share.has_open_stream()) {
      camera.sessions.insert(share.session_id());
    }
    if (!share.has_open_stream()) continue;
    camera.is_open = true;
    // Another camera of the session went on for longer.
    const double longest = longest_s[share.session_id()];
    if (longest > 0) camera.share = std::max(camera.share, 1 - share.span_s() / longest);
  }
  for (auto& [name, camera] : missing) {
    if (camera.count() == 0) continue;
    camera.share = std::max(
        camera.share, static_cast<double>(camera.count()) / static_cast<double>(camera.detected));
  }
  return missing;
}

std::string AdviceFor(const MissingRows& missing) {
  std::vector<std::string> parts;
  if (missing.count() > 0) {
    std::vector<std::string> where;
    const uint64_t others =
        missing.count() - std::min(missing.count(), missing.damaged + missing.late);
    if (missing.damaged > 0) where.push_back(absl::StrCat(missing.damaged, " are damaged"));
    if (missing.late > 0) {
      where.push_back(absl::StrCat(missing.late, " came after the session had finished"));
    }
    if (others > 0) where.push_back(absl::StrCat(others, " were dropped or not delivered"));
    parts.push_back(
        absl::StrCat(missing.count(), " of its ", missing.detected,
                     " observations are not in this calibration: ", absl::StrJoin(where, ", ")));
  }
  if (missing.is_open) {
    parts.push_back(
        "nothing tells where its stream ended, and how much was detected behind its last row");
  }
  return absl::StrCat(
      absl::StrJoin(parts, "; "), ". `rigcal session verify ",
      absl::StrJoin(missing.sessions, "` and `rigcal session verify "),
      "` says where they are. Start the agent that still has them and calibrate again, "
      "or record again");
}

// A camera that is not in the result does not spoil it.
FindingSeverity SeverityOf(const MissingRows& missing, bool is_in_result) {
  if (!is_in_result) return FindingSeverity::kWarning;
  if (missing.share > kBadWithoutShare) return FindingSeverity::kError;
  if (missing.share > kUsableWithoutShare || missing.is_open) return FindingSeverity::kWarning;
  return FindingSeverity::kInfo;
}

void CapGrade(FindingSeverity severity, std::string reason, Quality* quality) {
  if (severity == FindingSeverity::kInfo || quality->grade == QualityGrade::kNotEvaluated) return;
  const QualityGrade cap =
      severity == FindingSeverity::kError ? QualityGrade::kBad : QualityGrade::kUsable;
  if (quality->grade > cap) return;
  // The reasons are those for the grade.
  if (quality->grade < cap) quality->reasons.clear();
  quality->grade = cap;
  quality->reasons.push_back(std::move(reason));
}

}  // namespace

RowShare::RowShare(std::string session_id, std::string camera, const SessionCameraCounts* counts)
    : session_id_(std::move(session_id)), camera_(std::move(camera)) {
  if (counts == nullptr) return;
  has_open_stream_ = !counts->ended();
  for (const StreamStatus& stream : counts->streams) {
    has_open_stream_ = has_open_stream_ || stream.end_is_unknown;
    last_seq_[stream.stream_epoch] =
        std::max({stream.durable_seq, stream.last_seq.value_or(0), stream.reported_seq});
  }
}

void RowShare::Add(const StoredBatch& stored) {
  const uint64_t rows = stored.damaged_rows > 0 ? stored.damaged_rows : stored.batch.rows();
  if (rows == 0) return;
  uint64_t& last_seq = last_seq_[stored.batch.stream.stream_epoch];
  last_seq = std::max(last_seq, stored.batch.first_seq + rows - 1);
  if (stored.damaged_rows > 0) {
    damaged_ += rows;
  } else if (stored.late) {
    late_ += rows;
  } else {
    read_ += rows;
    const auto [first_ns, last_ns] = std::ranges::minmax(stored.batch.time_ns);
    const auto [times, is_new] = times_ns_.try_emplace(stored.batch.clock_epoch, first_ns, last_ns);
    if (is_new) return;
    times->second.first = std::min(times->second.first, first_ns);
    times->second.second = std::max(times->second.second, last_ns);
  }
}

uint64_t RowShare::detected() const {
  uint64_t sum = 0;
  for (const auto& [epoch, last_seq] : last_seq_) sum += last_seq;
  return sum;
}

double RowShare::span_s() const {
  double span_s = 0;
  for (const auto& [epoch, times] : times_ns_) {
    span_s += 1e-9 * (static_cast<double>(times.second) - static_cast<double>(times.first));
  }
  return span_s;
}

void NoteIncompleteSessions(absl::Span<const RowShare> shares, const CalibrationOptions& options,
                            CalibrationResult* result) {
  for (const auto& [camera, missing] : MissingByCamera(shares, options)) {
    if (missing.count() == 0 && !missing.is_open) continue;
    Finding& finding = result->findings.emplace_back();
    finding.kind = FindingKind::kIncompleteSession;
    finding.camera = camera;
    finding.value = 100 * missing.share;
    finding.unit = "%";
    finding.advice = AdviceFor(missing);
    if (ChangesFrameOnly(options.kind)) continue;
    finding.severity = SeverityOf(
        missing, std::ranges::count(result->cameras, camera, &CalibratedCamera::camera) > 0);
    CapGrade(finding.severity,
             missing.share > kUsableWithoutShare
                 ? absl::StrFormat(
                       "camera %s: %s%.3g %% of its observations are missing, more than "
                       "%.3g %%",
                       camera, missing.is_open ? "at least " : "", 100 * missing.share,
                       100 * (finding.severity == FindingSeverity::kError ? kBadWithoutShare
                                                                          : kUsableWithoutShare))
                 : absl::StrCat("camera ", camera,
                                ": nothing tells where its stream ended, and how many of its "
                                "observations are missing"),
             &result->quality);
  }
}

}  // namespace rigcal::server
