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

const char* NameOfIntrinsics(Estimate intrinsics) {
  if (intrinsics == Estimate::kDefault) return "chosen";
  return intrinsics == Estimate::kFixed ? "kept" : "refined";
}

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

// Of each seed a line for each treatment of the lenses, and the line delays of the default.
int FlySeeds(int seeds, const server::SimulatedFlightOptions& first, bool spline, bool brief) {
  for (int i = 0; i < seeds; ++i) {
    server::SimulatedFlightOptions simulated = first;
    simulated.seed += static_cast<uint32_t>(i);
    const server::SimulatedFlight flight = server::FlyPoint(simulated);
    for (const Estimate intrinsics : {Estimate::kDefault, Estimate::kFixed, Estimate::kRefined}) {
      CalibrationOptions options;
      options.intrinsics = intrinsics;
      if (spline) options.trajectory = TrajectoryChoice::kSpline;
      if (brief && intrinsics != Estimate::kDefault) continue;
      const absl::StatusOr<FlightRun> run = RunSimulatedFlight(flight, options);
      if (!run.ok()) {
        fmt::print("seed {}: {}\n", simulated.seed, run.status().ToString());
        continue;
      }
      const auto& cameras = run->result.cameras;
      fmt::print("seed {:3} {:8} mean {:7.2f} cm  median {:7.2f} cm  {} {} {:6.1f} CPU s\n",
                 simulated.seed, NameOfIntrinsics(intrinsics), 1e2 * run->errors.mean_m,
                 1e2 * run->errors.median_m,
                 cameras.front().intrinsics_refined ? "refined" : "kept   ",
                 run->result.trajectory.kind == CalibratedTrajectory::Kind::kSpline ? "spline  "
                                                                                    : "instants",
                 run->cpu_s);
      if (intrinsics != Estimate::kDefault) continue;
      for (size_t c = 0; c < cameras.size(); ++c) {
        fmt::print("    {} {:.1f} Hz, line delay {:6.2f} us, found {:6.2f} +- {:.2f}\n",
                   cameras[c].camera, flight.cameras[c].rate_hz,
                   1e6 * flight.cameras[c].line_delay_s, 1e6 * cameras[c].line_delay_s,
                   1e6 * cameras[c].line_delay_sigma_s);
      }
      for (const Finding& finding : run->result.findings) {
        fmt::print("    {} {} {:.3g} {}: {}\n", NameOf(finding.kind), finding.camera, finding.value,
                   finding.unit, finding.advice.substr(0, 150));
      }
    }
  }
  return 0;
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
    PrintFlight(NameOfIntrinsics(intrinsics), *run);
  }
  return 0;
}

}  // namespace

Experiment Flight() {
  return {"flight", "consumer cameras that nothing synchronised; needs test data, or simulates",
          [](OptionList* options) -> Experiment::Run {
            struct Asked {
              bool spline = false, global = false, brief = false;
              int seeds = 0, first_seed = 1;
              server::SimulatedFlightOptions simulated;
            };
            const auto asked = std::make_shared<Asked>();
            options->AddFlag("--spline", &asked->spline, "follow the target through time");
            options->Add("--simulated", &asked->seeds, 0, 1000,
                         "so many simulated flights instead of the recording");
            options->Add("--first-seed", &asked->first_seed, 1, 1 << 30, "of the simulated ones");
            options->Add("--cameras", &asked->simulated.camera_count, 2, 20, "of these");
            options->Add("--duration", &asked->simulated.duration_s, 10, 3600, "of these, seconds");
            options->Add("--noise", &asked->simulated.noise_px, 0.05, 5, "of these, px");
            options->Add("--focal", &asked->simulated.focal_sigma_rel, 0, 0.1,
                         "one sigma of the given focal lengths, relative");
            options->Add("--ppm", &asked->simulated.largest_rate_ppm, 0, 2000,
                         "largest rate of their clocks");
            options->AddFlag("--brief", &asked->brief, "of the simulated ones the default only");
            options->AddFlag("--global", &asked->global, "without rolling shutters");
            return [asked] {
              if (asked->seeds == 0) return RunFlights(asked->spline);
              asked->simulated.seed = static_cast<uint32_t>(asked->first_seed);
              if (asked->global) asked->simulated.shortest_s = asked->simulated.longest_s = 0;
              return FlySeeds(asked->seeds, asked->simulated, asked->spline, asked->brief);
            };
          }};
}

}  // namespace rigcal::accuracy
