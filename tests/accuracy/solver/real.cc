// SPDX-License-Identifier: Apache-2.0
// The real recording `ewand`, calibrated with all defaults, and with its clocks changed by known
// amounts or all of them moved, as if each camera had been started by hand. Found in ../shared/data
// beside the project, or in RIGCAL_TEST_DATA.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/simulation/world/random_stream.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/recording.h"
#include "tests/accuracy/solver/solver_experiments.h"

namespace rigcal::accuracy {
namespace {

std::string Px(const std::optional<ErrorFigures>& figures, double ErrorFigures::*figure) {
  if (!figures || figures->marker_count == 0) return "-";
  return fmt::format("{:.3f}", (*figures).*figure);
}

double MiddleTimeS(const server::CalibrationInput& input, const std::string& name) {
  for (const server::CameraTrack& track : input.tracks) {
    if (track.camera.camera != name) continue;
    return 1e-9 * static_cast<double>(track.observations[track.observations.size() / 2].time_ns);
  }
  return 0;
}

void PrintCameras(const server::CalibrationInput& input, const CalibrationResult& result) {
  fmt::print("{} instants; -: not computed\n", result.instant_count);
  fmt::print(
      "camera    mean px  in mean  out of %   held-out  LOO mean  LOO med   LOO p95  offset ms"
      "   sigma ms  others ms  rate ppm  focal\n");
  for (const CalibratedCamera& camera : result.cameras) {
    const Residuals& residuals = camera.residuals;
    const double out = 100.0 * residuals.outlier_count / std::max(1u, residuals.all.marker_count);
    const double sigma_ms = camera.uncertainty ? 1e3 * camera.uncertainty->time_offset_sigma_s : 0;
    fmt::print(
        "{:8} {:8.3f} {:8.3f} {:9.2f} {:>10} {:>9} {:>8} {:>9} {:10.3f} {:>10} {:10.3f} {:9.1f}"
        "  {}\n",
        camera.camera, residuals.all.mean_px, residuals.inlier.mean_px, out,
        Px(camera.held_out, &ErrorFigures::mean_px),
        Px(camera.leave_one_out, &ErrorFigures::mean_px),
        Px(camera.leave_one_out, &ErrorFigures::median_px),
        Px(camera.leave_one_out, &ErrorFigures::p95_px), 1e3 * camera.time_offset_s,
        sigma_ms > 0 ? fmt::format("{:.4f}", sigma_ms) : "-",
        1e3 * OffsetAgainstOthersS(result, camera.camera, MiddleTimeS(input, camera.camera)),
        camera.time_rate_ppm, camera.intrinsics_refined ? "refined" : "as given");
  }
}

void PrintTarget(const CalibrationResult& result) {
  fmt::print("\nspan m    mean mm   rms mm  held-out rms mm\n");
  for (const SpanError& span : result.target.spans) {
    fmt::print(
        "{:7.5f} {:9.3f} {:8.3f} {:>16}\n", span.length_m, 1e3 * span.mean_error_m,
        1e3 * span.error_rms_m,
        span.held_out_count > 0 ? fmt::format("{:.3f}", 1e3 * span.held_out_error_rms_m) : "-");
  }
  if (result.target.scale_sigma_rel > 0) {
    fmt::print("scale known to {:.3f} %\n", 100 * result.target.scale_sigma_rel);
  } else {
    fmt::print("uncertainty of the scale: not computed\n");
  }
  static const char* const kGrades[] = {"not evaluated", "good", "usable", "bad"};
  fmt::print("quality: {}\n", kGrades[static_cast<size_t>(result.quality.grade)]);
  for (const std::string& reason : result.quality.reasons) fmt::print("  {}\n", reason);
  for (const Finding& finding : result.findings) {
    fmt::print("finding: {} {} {:.4g} {}: {}\n", NameOf(finding.kind),
               finding.camera.empty() ? "rig" : finding.camera, finding.value, finding.unit,
               finding.advice);
  }
}

// The shift of the middle row's timestamp.
double StampShiftS(const server::CalibrationInput& input, const ClockChange& change) {
  for (const server::CameraTrack& track : input.tracks) {
    if (track.camera.camera != change.camera) continue;
    const double first_s = 1e-9 * static_cast<double>(track.observations.front().time_ns);
    return change.shift_s + 1e-6 * change.rate_ppm * (MiddleTimeS(input, change.camera) - first_s);
  }
  return 0;
}

struct ChangeRow {
  ClockChange change;
  absl::Status status;
  double offset_error_s = 0;  // of the difference from the unchanged run
  double rate_error_ppm = 0;
};

// Clocks are compared at the middle row of the unchanged camera, where a wrong rate matters least.
ChangeRow RunChange(const server::CalibrationInput& input, const CalibrationResult& base,
                    const ClockChange& change) {
  ChangeRow row{change, absl::OkStatus(), 0, 0};
  const absl::StatusOr<server::CalibrationInput> changed = Change(input, change);
  if (!changed.ok()) {
    row.status = changed.status();
    return row;
  }
  const server::CalibrationOutcome outcome = server::Calibrate(*changed, {});
  row.status = outcome.result.status();
  if (!row.status.ok()) return row;
  const double before_s =
      OffsetAgainstOthersS(base, change.camera, MiddleTimeS(input, change.camera));
  const double moved_s = StampShiftS(input, change);
  const double after_s = OffsetAgainstOthersS(*outcome.result, change.camera,
                                              MiddleTimeS(input, change.camera) + moved_s);
  row.offset_error_s = after_s - before_s + moved_s;
  row.rate_error_ppm = RateAgainstOthersPpm(*outcome.result, change.camera) -
                       RateAgainstOthersPpm(base, change.camera) + change.rate_ppm;
  return row;
}

void PrintChanges(const server::CalibrationInput& input, const CalibrationResult& base) {
  std::vector<ClockChange> changes;
  for (const CalibratedCamera& camera : base.cameras) {
    for (const double shift_s : {0.0, 0.003, 0.060, -0.700}) {
      changes.push_back({camera.camera, shift_s, 0, true});
    }
    changes.push_back({camera.camera, 0, 50, false});
  }
  const auto rows = RunAll<ChangeRow>(static_cast<int>(changes.size()), 2, [&](int i) {
    return RunChange(input, base, changes[static_cast<size_t>(i)]);
  });
  fmt::print("\ncamera   every third row  shift ms  rate ppm   offset error ms  rate error ppm\n");
  for (const ChangeRow& row : rows) {
    fmt::print("{:8} {:>15} {:9.0f} {:9.0f}", row.change.camera,
               row.change.drop_every_third ? "removed" : "kept", 1e3 * row.change.shift_s,
               row.change.rate_ppm);
    if (row.status.ok()) {
      fmt::print(" {:17.4f} {:15.2f}\n", 1e3 * row.offset_error_s, row.rate_error_ppm);
    } else {
      fmt::print("   FAILED: {}\n", row.status.ToString());
    }
  }
}

constexpr int kMoveDraws = 8;
constexpr double kFarthestMoveS = 30;
constexpr uint64_t kMovesPurpose = 0x6d6f766573;

struct MovedRun {
  absl::Status status;
  double position_m = 0, offset_s = 0;  // largest differences from the run without moves
};

MovedRun RunMoved(server::CalibrationInput input, const CalibrationResult& base, uint32_t seed) {
  RandomStream random{seed, kMovesPurpose};
  std::vector<double> moved_s;
  for (server::CameraTrack& track : input.tracks) {
    moved_s.push_back(random.Uniform(-kFarthestMoveS, kFarthestMoveS));
    for (Observation& row : track.observations) row.time_ns += std::llround(1e9 * moved_s.back());
  }
  const server::CalibrationOutcome outcome = server::Calibrate(std::move(input), {});
  MovedRun run{outcome.result.status(), 0, 0};
  if (!run.status.ok()) return run;
  const auto &before = base.cameras, &after = outcome.result->cameras;
  for (size_t c = 0; c < before.size(); ++c) {
    const Eigen::Vector3d step_m = after[c].cam_from_rig.SourceFromTargetTranslation() -
                                   before[c].cam_from_rig.SourceFromTargetTranslation();
    const double offset_s = after[c].time_offset_s - after[0].time_offset_s + moved_s[c] -
                            (before[c].time_offset_s - before[0].time_offset_s + moved_s[0]);
    run.position_m = std::max(run.position_m, step_m.norm());
    run.offset_s = std::max(run.offset_s, std::abs(offset_s));
  }
  return run;
}

void PrintMoves(const server::CalibrationInput& input, const CalibrationResult& base) {
  const auto runs = RunAll<MovedRun>(
      kMoveDraws, 2, [&](int i) { return RunMoved(input, base, static_cast<uint32_t>(i)); });
  int failed = 0;
  double position_m = 0, offset_s = 0;
  for (const MovedRun& run : runs) {
    failed += run.status.ok() ? 0 : 1;
    position_m = std::max(position_m, run.position_m);
    offset_s = std::max(offset_s, run.offset_s);
  }
  fmt::print(
      "\nall clocks moved by up to {} s, {} draws: {} failed, largest change of a position {:.5f} "
      "mm, of an offset {:.5f} ms\n",
      kFarthestMoveS, kMoveDraws, failed, 1e3 * position_m, 1e3 * offset_s);
}

int RunReal() {
  const absl::StatusOr<server::CalibrationInput> input = WandRecording();
  if (!input.ok()) {
    fmt::print(stderr, "{}\n", input.status().ToString());
    return 1;
  }
  const server::CalibrationOutcome base = server::Calibrate(*input, {});
  if (!base.result.ok()) {
    fmt::print(stderr, "{}\n", base.result.status().ToString());
    return 1;
  }
  PrintCameras(*input, *base.result);
  PrintTarget(*base.result);
  PrintChanges(*input, *base.result);
  PrintMoves(*input, *base.result);
  return 0;
}

}  // namespace

Experiment Real() {
  return {"real", "the real recording, also with its clocks changed; needs test data",
          [](OptionList*) { return RunReal; }};
}

}  // namespace rigcal::accuracy
