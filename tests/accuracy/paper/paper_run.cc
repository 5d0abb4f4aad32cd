// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/paper/paper_run.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/triangulate/triangulate_rows.h"
#include "server/solve/calibrate.h"
#include "tests/accuracy/paper/index_paired_solve.h"
#include "tests/accuracy/paper/paper_films.h"
#include "tests/accuracy/paper/spline_solve.h"
#include "tests/accuracy/seed_runs.h"

namespace rigcal::accuracy {
namespace {

constexpr double kNothingLeftOut = 1e6;  // sigmas
constexpr PaperTarget kTargets[] = {PaperTarget::kWand, PaperTarget::kCircles,
                                    PaperTarget::kChecker};
constexpr int kTargetCount = static_cast<int>(std::size(kTargets));
constexpr int kConditionCount = static_cast<int>(std::size(kPaperConditions));

std::vector<PaperMethod> MethodsOf(PaperTarget target) {
  switch (target) {
    case PaperTarget::kWand:
      return {PaperMethod::kWandIndexPaired, PaperMethod::kWand, PaperMethod::kTruth};
    case PaperTarget::kCircles:
      return {PaperMethod::kCircles, PaperMethod::kCirclesSpline};
    case PaperTarget::kChecker:
      return {PaperMethod::kChecker, PaperMethod::kCheckerSpline};
  }
  return {};
}

bool IsAsked(const PaperOptions& options, const PaperCondition& condition, PaperMethod method) {
  const bool board = method != PaperMethod::kWandIndexPaired && method != PaperMethod::kWand &&
                     method != PaperMethod::kTruth;
  if (condition.boards_noisy_as_wand && (!board || !options.points)) return false;
  PaperRow row;
  row.condition = condition.name;
  row.method = method;
  return NameOf(row).find(options.only) != std::string::npos;
}

// One method on one recording.
struct Outcome {
  PaperMethod method = PaperMethod::kWand;
  absl::Status status;
  CalibrationResult calibration;
  PathErrors path, exact_path;
  std::vector<std::pair<std::string, int>> views;  // by camera
  std::vector<std::optional<PathErrors>> course;   // exact, by share; none: not solved
};

Outcome Judge(PaperMethod method, absl::StatusOr<CalibrationResult> calibration,
              const PaperRecording& recording) {
  Outcome outcome;
  outcome.method = method;
  outcome.views = recording.views;
  outcome.status = calibration.status();
  if (!calibration.ok()) return outcome;
  const auto path = ComparePathOf(*calibration, recording.marker, recording.path);
  const auto exact = ComparePathOf(*calibration, recording.exact_marker, recording.path);
  outcome.status.Update(path.status());
  outcome.status.Update(exact.status());
  if (!outcome.status.ok()) return outcome;
  outcome.path = *path;
  outcome.exact_path = *exact;
  outcome.calibration = *std::move(calibration);
  return outcome;
}

absl::StatusOr<CalibrationResult> Solve(PaperMethod method, const PaperRecording& recording) {
  switch (method) {
    case PaperMethod::kTruth:
      return recording.true_rig;
    case PaperMethod::kWandIndexPaired:
      return SolveIndexPaired(recording.input);
    case PaperMethod::kCirclesSpline:
    case PaperMethod::kCheckerSpline:
      return SolveSpline(recording.input);
    case PaperMethod::kWand:
    case PaperMethod::kCircles:
    case PaperMethod::kChecker:
      break;
  }
  CalibrationOptions solve;
  if (method != PaperMethod::kWand) solve.marker_positions = Estimate::kFixed;
  return server::Calibrate(recording.input, solve).result;
}

// The first share of a wave.
PaperRecording Shortened(const PaperRecording& recording, double duration_s) {
  PaperRecording shorter = recording;
  int64_t begin_ns = std::numeric_limits<int64_t>::max();
  for (const server::CameraTrack& track : recording.input.tracks) {
    if (!track.observations.empty()) {
      begin_ns = std::min(begin_ns, track.observations.front().time_ns);
    }
  }
  const int64_t end_ns = begin_ns + std::llround(1e9 * duration_s);
  for (server::CameraTrack& track : shorter.input.tracks) {
    std::erase_if(track.observations,
                  [&](const Observation& row) { return row.time_ns >= end_ns; });
  }
  std::erase_if(shorter.input.tracks, [](const server::CameraTrack& track) {
    return ViewCount(track.observations) < kPaperLeastViews;
  });
  return shorter;
}

std::vector<std::optional<PathErrors>> CourseOf(PaperMethod method, const PaperRecording& recording,
                                                double duration_s) {
  std::vector<std::optional<PathErrors>> course;
  for (const double share : kPaperShares) {
    auto& errors = course.emplace_back();
    const PaperRecording shorter = Shortened(recording, share * duration_s);
    const absl::StatusOr<CalibrationResult> calibration = Solve(method, shorter);
    if (!calibration.ok()) continue;
    const auto exact = ComparePathOf(*calibration, shorter.exact_marker, shorter.path);
    if (exact.ok()) errors = *exact;
  }
  return course;
}

// `course_s`: of the wave, whose shares are solved too; 0: only the whole.
std::vector<Outcome> RunTarget(const absl::StatusOr<PaperRecording>& recording, double course_s,
                               const std::vector<PaperMethod>& asked) {
  std::vector<Outcome> outcomes;
  if (!recording.ok()) {
    for (const PaperMethod method : asked) {
      outcomes.push_back(Judge(method, recording.status(), PaperRecording()));
    }
    return outcomes;
  }
  for (const PaperMethod method : asked) {
    outcomes.push_back(Judge(method, Solve(method, *recording), *recording));
    if (course_s > 0 && method != PaperMethod::kTruth) {
      outcomes.back().course = CourseOf(method, *recording, course_s);
    }
  }
  return outcomes;
}

void AddOutcome(const Outcome& outcome, bool bumped_later, PaperRow* row) {
  if (!outcome.status.ok()) {
    row->first_failure.Update(outcome.status);
    return;
  }
  // A bump after the calibration changes nothing of it.
  const bool has_residuals = row->method != PaperMethod::kTruth && !bumped_later;
  if (has_residuals) row->cameras.resize(outcome.views.size());
  for (size_t c = 0; c < row->cameras.size(); ++c) {
    PaperCamera& camera = row->cameras[c];
    camera.camera = outcome.views[c].first;
    camera.views += outcome.views[c].second;
    const auto found =
        std::ranges::find(outcome.calibration.cameras, camera.camera, &CalibratedCamera::camera);
    if (found == outcome.calibration.cameras.end()) continue;
    const ErrorFigures& all = found->residuals.all;
    camera.error_px.Add(all.mean_px, all.rms_px, all.marker_count);
  }
  row->course.resize(outcome.course.size());
  for (size_t i = 0; i < row->course.size(); ++i) {
    row->course[i].waved_s = kPaperShares[i] * row->waved_s;
    if (!outcome.course[i]) continue;
    row->course[i].exact_path_m.Add(*outcome.course[i]);
    ++row->course[i].solved;
  }
  row->path_m.Add(outcome.path);
  row->exact_path_m.Add(outcome.exact_path);
  row->instants =
      (row->instants * row->solved + outcome.calibration.instant_count) / (row->solved + 1);
  ++row->solved;
}

}  // namespace

const char* NameOf(PaperMethod method) {
  static const char* const kNames[kPaperMethods] = {"wand, paired by index",
                                                    "wand by rigcal",
                                                    "circle board by rigcal",
                                                    "checkerboard by rigcal",
                                                    "circle board, stand-in for kalibr",
                                                    "checkerboard, stand-in for kalibr",
                                                    "the true rig"};
  return kNames[static_cast<size_t>(method)];
}

std::string NameOf(const PaperRow& row) {
  return absl::StrCat(row.condition, ": ", NameOf(row.method));
}

std::optional<double> EnoughWavingS(const PaperRow& row) {
  constexpr double kEnough = 1.2;
  std::optional<double> enough_s;
  for (size_t i = row.course.size(); i-- > 0;) {
    const PaperShorterWave& shorter = row.course[i];
    // A wave that some seed cannot be solved from is too short.
    if (shorter.solved < row.solved ||
        !(shorter.exact_path_m.Mean() <= kEnough * row.course.back().exact_path_m.Mean())) {
      break;
    }
    enough_s = shorter.waved_s;
  }
  return enough_s;
}

void PaperSums::Add(double mean, double rms, double added_count) {
  count += added_count;
  sum += added_count * mean;
  squares += added_count * rms * rms;
}

void PaperSums::Add(const PathErrors& errors) {
  Add(errors.mean_m, errors.rms_m, static_cast<double>(errors.count));
}

double PaperSums::StandardDeviation() const {
  return std::sqrt(std::max(0.0, squares / count - Mean() * Mean()));
}

absl::StatusOr<PathErrors> ComparePathOf(const CalibrationResult& calibration,
                                         const std::vector<CameraRows>& marker,
                                         const ReferencePath& path) {
  TriangulationOptions options;
  options.sigma_px = 1;
  options.max_sigmas = kNothingLeftOut;
  std::vector<CameraRows> known;
  for (const CameraRows& rows : marker) {
    if (std::ranges::find(calibration.cameras, rows.camera, &CalibratedCamera::camera) !=
        calibration.cameras.end()) {
      known.push_back(rows);
    }
  }
  RIGCAL_ASSIGN_OR_RETURN(const Triangulation triangulation,
                          TriangulateRows(calibration, std::move(known), options));
  std::vector<TimedPosition> points;
  for (const TriangulatedPoint& point : triangulation.points) {
    points.push_back({1e-9 * static_cast<double>(point.rig_time_ns), point.position_m});
  }
  return ComparePaths(points, path, {.length_scale = false, .time_scale = false});
}

std::vector<PaperRow> RunPaper(const PaperOptions& options) {
  std::vector<PaperRow> rows;
  for (const PaperCondition& condition : kPaperConditions) {
    for (int m = 0; m < kPaperMethods; ++m) {
      PaperRow& row = rows.emplace_back();
      row.condition = condition.name;
      row.method = static_cast<PaperMethod>(m);
      if (row.method != PaperMethod::kTruth) row.waved_s = options.recording.duration_s;
    }
  }
  PaperFilms films;
  const int count = options.seeds * kConditionCount * kTargetCount;
  const auto runs = RunAll<std::vector<Outcome>>(count, options.threads, [&](int i) {
    const PaperTarget target = kTargets[i % kTargetCount];
    const PaperCondition& condition = kPaperConditions[i / kTargetCount % kConditionCount];
    PaperRecordingOptions recording = options.recording;
    recording.seed = static_cast<uint32_t>(options.first_seed + i / kTargetCount / kConditionCount);
    recording.first_camera_early_s = condition.first_camera_early_s;
    recording.bump_m = condition.bump_m;
    recording.bump_rad = condition.bump_deg * std::numbers::pi / 180;
    recording.wand_sigma_m = condition.wand_sigma_m;
    recording.board_sigma_m = condition.board_sigma_m;
    recording.boards_noisy_as_wand = condition.boards_noisy_as_wand;
    std::vector<PaperMethod> asked = MethodsOf(target);
    std::erase_if(asked, [&](PaperMethod method) { return !IsAsked(options, condition, method); });
    if (asked.empty()) return std::vector<Outcome>();
    const bool has_course = &condition == &kPaperConditions[0];
    return RunTarget(
        options.points ? RecordPaper(recording, target) : films.Record(recording, target),
        has_course ? recording.duration_s : 0, asked);
  });
  for (int i = 0; i < count; ++i) {
    const int condition = i / kTargetCount % kConditionCount;
    for (const Outcome& outcome : runs[static_cast<size_t>(i)]) {
      AddOutcome(outcome, kPaperConditions[condition].bump_m > 0,
                 &rows[static_cast<size_t>(condition * kPaperMethods) +
                       static_cast<size_t>(outcome.method)]);
    }
  }
  std::erase_if(rows,
                [](const PaperRow& row) { return row.solved == 0 && row.first_failure.ok(); });
  return rows;
}

}  // namespace rigcal::accuracy
