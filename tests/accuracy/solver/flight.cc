// SPDX-License-Identifier: Apache-2.0
// The recording `flight` of consumer cameras that nothing synchronised, against the path of what
// they saw. Found in ../shared/data beside the project, or in RIGCAL_TEST_DATA.
#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <memory>

#include "tests/accuracy/solver/flight_experiment.h"
#include "tests/accuracy/solver/recording.h"
#include "tests/accuracy/solver/solver_experiments.h"

namespace rigcal::accuracy {
namespace {

void PrintFlight(const char* intrinsics, const FlightRun& run) {
  fmt::print(
      "\nintrinsics {}: path of {} points, mean {:.1f}, rms {:.1f}, median {:.1f} cm from "
      "RTK; {:.1f} CPU s\n",
      intrinsics, run.errors.count, 1e2 * run.errors.mean_m, 1e2 * run.errors.rms_m,
      1e2 * run.errors.median_m, run.cpu_s);
  fmt::print("camera  offset s  rate ppm  mean px  out of %  LOO mean  focal\n");
  const auto& cameras = run.result.cameras;
  for (const CalibratedCamera& camera : cameras) {
    const Residuals& residuals = camera.residuals;
    fmt::print("{:6} {:9.4f} {:9.1f} {:8.3f} {:9.2f} {:9.3f}  {}\n", camera.camera,
               camera.time_offset_s - cameras.front().time_offset_s, camera.time_rate_ppm,
               residuals.all.mean_px,
               100.0 * residuals.outlier_count / std::max(1u, residuals.all.marker_count),
               camera.leave_one_out ? camera.leave_one_out->mean_px : 0,
               camera.intrinsics_refined ? "refined" : "as given");
  }
  static const char* const kGrades[] = {"not evaluated", "good", "usable", "bad"};
  fmt::print("quality: {}\n", kGrades[static_cast<size_t>(run.result.quality.grade)]);
  for (const std::string& reason : run.result.quality.reasons) fmt::print("  {}\n", reason);
  for (const Finding& finding : run.result.findings) {
    fmt::print("  {} {} {:.3g} {}: {}\n", NameOf(finding.kind), finding.camera, finding.value,
               finding.unit, finding.advice);
  }
}

int RunFlights(bool spline) {
  const absl::StatusOr<std::filesystem::path> data = RecordingsFolder();
  if (!data.ok()) {
    fmt::print(stderr, "{}\n", data.status().ToString());
    return 1;
  }
  for (const Estimate intrinsics : {Estimate::kDefault, Estimate::kFixed, Estimate::kRefined}) {
    CalibrationOptions options;
    options.intrinsics = intrinsics;
    if (spline) options.trajectory = TrajectoryChoice::kSpline;
    const absl::StatusOr<FlightRun> run = RunFlight(*data, options);
    if (!run.ok()) {
      fmt::print(stderr, "{}\n", run.status().ToString());
      return 1;
    }
    const bool asked = intrinsics != Estimate::kDefault;
    PrintFlight(asked ? (intrinsics == Estimate::kFixed ? "kept" : "refined") : "chosen", *run);
  }
  return 0;
}

}  // namespace

Experiment Flight() {
  return {"flight", "consumer cameras that nothing synchronised; needs test data",
          [](OptionList* options) -> Experiment::Run {
            const auto spline = std::make_shared<bool>(false);
            options->AddFlag("--spline", spline.get(), "follow the target through time");
            return [spline] { return RunFlights(*spline); };
          }};
}

}  // namespace rigcal::accuracy
