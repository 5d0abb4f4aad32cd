// SPDX-License-Identifier: Apache-2.0
// CPU seconds of whole calibrations of simulated rigs, findings included, by number of cameras and
// seconds of recording (25 views a second of each), with the default options, as the worker runs
// them. The counters are the seconds of each stage (CalibrationStage), and the error of the
// reconstructed rig. `Lens`: the given intrinsics are wrong by what a calibration of each lens is
// (0.3 % of the focal length), so that they are refined. `Clocks`: clocks are up to 0.25 s apart
// and run at rates of their own.
#include <benchmark/benchmark.h>
#include <time.h>

#include <map>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/simulation/world/simulated_world.h"
#include "server/solve/calibrate.h"
#include "tests/bench/must.h"
#include "tests/bench/suites.h"
#include "tests/server/solve/simulated_input.h"

namespace rigcal::bench::calibrate_bench {
namespace {

double CpuSeconds() {
  timespec now = {};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

enum class Disturbance { kNone, kLens, kClocks };

SimulationOptions OptionsOf(int cameras, int seconds, Disturbance disturbance) {
  SimulationOptions options;
  options.camera_count = cameras;
  options.duration_s = seconds;
  if (disturbance == Disturbance::kLens) {
    options.focal_sigma_rel = 0.003;
    options.centre_sigma_px = 2;
    options.radial_sigma = 0.01;
  }
  if (disturbance == Disturbance::kClocks) {
    for (int c = 1; c < cameras; ++c) {
      const int step = (c * 7) % 11 - 5;  // -5 to 5
      options.time_offset_s[c] = 0.05 * step;
      options.time_rate_ppm[c] = 10.0 * step;
    }
  }
  return options;
}

// Of CalibrationStage, in its order.
constexpr const char* kStages[] = {"",       "read",   "associate", "search", "initialize",
                                   "adjust", "choose", "evaluate",  "report"};

void Whole(benchmark::State& state, Disturbance disturbance) {
  const SimulatedWorld world = Must(SimulatedWorld::Create(
      OptionsOf(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)), disturbance),
      server::WandTarget()));
  for (auto _ : state) {
    state.PauseTiming();
    server::CalibrationInput input = server::InputOf(world);
    state.ResumeTiming();
    std::map<CalibrationStage, double> spent_s;
    CalibrationStage stage = CalibrationStage::kAssociating;
    double since_s = CpuSeconds();
    const auto enter = [&](CalibrationStage next) {
      const double now_s = CpuSeconds();
      spent_s[stage] += now_s - since_s;
      since_s = now_s;
      stage = next;
    };
    server::CalibrationHooks hooks;
    hooks.progress = [&enter](CalibrationStage next, double) { enter(next); };
    const CalibrationResult result = Must(server::Calibrate(std::move(input), {}, hooks).result);
    enter(stage);
    for (const auto& [of, seconds] : spent_s) {
      state.counters[absl::StrCat(kStages[static_cast<size_t>(of)], "_s")] = seconds;
    }
    state.counters["rms_mm"] = 1e3 * server::ComparePoses(result, world).rms_position_m;
  }
}

void Register() {
  const auto add = [](const char* name, Disturbance disturbance,
                      const std::vector<std::vector<int64_t>>& sizes) {
    auto* const registered = benchmark::RegisterBenchmark(
        name, [disturbance](benchmark::State& state) { Whole(state, disturbance); });
    for (const std::vector<int64_t>& size : sizes) registered->Args(size);
    registered->ArgNames({"cameras", "seconds"})
        ->MeasureProcessCPUTime()
        ->Iterations(1)
        ->Unit(benchmark::kSecond);
  };
  add("calibrate/Whole", Disturbance::kNone, {{6, 60}, {24, 60}, {24, 200}, {6, 600}, {100, 60}});
  add("calibrate/Lens", Disturbance::kLens, {{24, 60}});
  add("calibrate/Clocks", Disturbance::kClocks, {{24, 60}});
}

}  // namespace
}  // namespace rigcal::bench::calibrate_bench

namespace rigcal::bench {

Suite CalibrateSuite() {
  return {"calibrate", "whole calibrations of large simulated rigs, stage by stage",
          calibrate_bench::Register};
}

}  // namespace rigcal::bench
