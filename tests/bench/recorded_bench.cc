// SPDX-License-Identifier: Apache-2.0
// Where the time goes in a calibration of the real recording `ewand`, everything estimated, one
// thread (OMP_THREAD_LIMIT=1). Whole: all of Calibrate, including held-out folds, model selection
// and findings. CoarseSearch: offsets of the clocks up to +-1 s. FineSolve: from those clocks alone
// (no poses) to poses, offsets, intrinsics and spacing, with outliers and labels settled, and their
// covariance. Adjustment: one bundle adjustment of the same problem, from the given intrinsics and
// no offsets. Needs ../shared/data beside the project, or RIGCAL_TEST_DATA.
#include <benchmark/benchmark.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "server/associate/align_clocks.h"
#include "server/solve/bundle/line_bundle.h"
#include "server/solve/calibrate.h"
#include "server/solve/clocks/time_search.h"
#include "server/solve/evaluate/uncertainty.h"
#include "server/solve/rig/rig_solver.h"
#include "tests/bench/must.h"
#include "tests/bench/suites.h"
#include "tests/server/solve/recorded_input.h"
#include "tests/testing/recorded_data.h"

namespace rigcal::testing::recorded_bench {
namespace {

using bench::Must;

struct Recording {
  server::CalibrationInput input;
  server::RigObservations rig;
  std::vector<server::ClockCorrection> clocks;    // as given
  std::vector<server::ClockCorrection> searched;  // after the coarse search
  server::BundleProblem solved;
};

Recording Load(const std::filesystem::path& data) {
  Recording recording;
  recording.input = Must(server::RecordedInput(data));
  server::CalibrationHooks hooks;
  hooks.solved = [&recording](const server::RigObservations& rig,
                              const server::RigSolution& solution) {
    recording.rig = rig;
    recording.solved = solution.built.problem;
  };
  Must(server::Calibrate(recording.input, {}, hooks).result);
  recording.rig.index = server::IndexRig(recording.rig.tracks, &recording.clocks);
  recording.searched = recording.clocks;
  Must(server::SearchTimeOffsets(recording.rig, 0, {}, &recording.searched));
  return recording;
}

// Null, with the benchmark skipped, if the recording is not there.
const Recording* LoadedRecording(benchmark::State& state) {
  const std::optional<std::filesystem::path> data = RecordedDataDirectory();
  if (!data) {
    state.SkipWithError("no recordings: put them into ../shared/data or set RIGCAL_TEST_DATA");
    return nullptr;
  }
  static const Recording recording = Load(*data);
  return &recording;
}

server::RigSolveOptions Everything() {
  server::RigSolveOptions options;
  options.estimate_time_offsets = true;
  options.refine_intrinsics = true;
  options.estimate_marker_positions = true;
  return options;
}

void Whole(benchmark::State& state) {
  const Recording* const recording = LoadedRecording(state);
  if (recording == nullptr) return;
  for (auto _ : state) Must(server::Calibrate(recording->input, {}).result);
}

void CoarseSearch(benchmark::State& state) {
  const Recording* const recording = LoadedRecording(state);
  if (recording == nullptr) return;
  for (auto _ : state) {
    std::vector<server::ClockCorrection> clocks = recording->clocks;
    Must(server::SearchTimeOffsets(recording->rig, 0, {}, &clocks));
  }
}

void FineSolve(benchmark::State& state) {
  const Recording* const recording = LoadedRecording(state);
  if (recording == nullptr) return;
  for (auto _ : state) {
    const server::RigSolution solution =
        Must(server::SolveRig(recording->rig, recording->searched, Everything()));
    Must(server::ComputeUncertainty(solution, Everything()));
    state.counters["iterations"] = solution.iterations;
  }
}

void Adjustment(benchmark::State& state) {
  const Recording* const recording = LoadedRecording(state);
  if (recording == nullptr) return;
  server::BundleProblem start = recording->solved;
  for (server::BundleCamera& camera : start.cameras) {
    if (!camera.intrinsics_fixed) camera.intrinsics = camera.intrinsics_mean;
  }
  for (server::BundleClock& clock : start.clocks) clock.time_offset_s = 0;
  for (auto _ : state) {
    server::BundleProblem problem = start;
    state.counters["iterations"] = Must(server::SolveLineBundle({}, &problem)).iterations;
  }
}

void Register() {
  for (const auto& [name, run] :
       {std::pair<const char*, void (*)(benchmark::State&)>("recorded/Whole", Whole),
        {"recorded/CoarseSearch", CoarseSearch},
        {"recorded/FineSolve", FineSolve},
        {"recorded/Adjustment", Adjustment}}) {
    benchmark::RegisterBenchmark(name, run)->Unit(benchmark::kMillisecond);
  }
}

}  // namespace
}  // namespace rigcal::testing::recorded_bench

namespace rigcal::bench {

Suite RecordedSuite() {
  return {"recorded", "stages of the calibration of the real recording; needs test data",
          testing::recorded_bench::Register};
}

}  // namespace rigcal::bench
