// SPDX-License-Identifier: Apache-2.0
// Where the time of a calibration of the real recording goes, everything estimated, one thread:
//
//   OMP_THREAD_LIMIT=1 build/release/tests/bench.recorded_bench
//
// Whole: all of Calibrate, held-out folds, choices and findings included. CoarseSearch: offsets of
// the clocks up to +-1 s. FineSolve: from those clocks and nothing else (no poses) to poses,
// offsets, intrinsics and spacing, outliers and labels settled, and their covariance. Adjustment:
// one bundle adjustment of the same problem, from the given intrinsics and no offsets.
//
// Reads the recording `ewand` in ../shared/data beside the project, or in RIGCAL_TEST_DATA.
#include <benchmark/benchmark.h>

#include <cstdio>
#include <cstdlib>
#include <optional>
#include <utility>

#include "server/associate/align_clocks.h"
#include "server/solve/bundle/line_bundle.h"
#include "server/solve/calibrate.h"
#include "server/solve/clocks/time_search.h"
#include "server/solve/evaluate/uncertainty.h"
#include "server/solve/rig/rig_solver.h"
#include "tests/accuracy/recording.h"
#include "tests/testing/recorded_data.h"

namespace rigcal::testing {
namespace {

template <typename T>
T Must(absl::StatusOr<T> result) {
  if (!result.ok()) {
    std::fprintf(stderr, "%s\n", result.status().ToString().c_str());
    std::exit(1);
  }
  return *std::move(result);
}

void Must(const absl::Status& status) {
  if (status.ok()) return;
  std::fprintf(stderr, "%s\n", status.ToString().c_str());
  std::exit(1);
}

struct Recording {
  server::CalibrationInput input;
  server::RigObservations rig;
  std::vector<server::ClockCorrection> clocks;    // as given
  std::vector<server::ClockCorrection> searched;  // after the coarse search
  server::BundleProblem solved;
};

const Recording& TheRecording() {
  static const Recording* const kRecording = [] {
    auto* const recording = new Recording;
    const std::optional<std::filesystem::path> data = RecordedDataDirectory();
    if (!data) {
      std::fprintf(stderr, "the real recordings are not there; set RIGCAL_TEST_DATA\n");
      std::exit(1);
    }
    recording->input = Must(accuracy::LoadRecording(*data));
    server::CalibrationHooks hooks;
    hooks.solved = [recording](const server::RigObservations& rig,
                               const server::RigSolution& solution) {
      recording->rig = rig;
      recording->solved = solution.built.problem;
    };
    Must(server::Calibrate(recording->input, {}, hooks).result);
    recording->rig.index = server::IndexRig(recording->rig.tracks, &recording->clocks);
    recording->searched = recording->clocks;
    Must(server::SearchTimeOffsets(recording->rig, 0, {}, &recording->searched));
    return recording;
  }();
  return *kRecording;
}

server::RigSolveOptions Everything() {
  server::RigSolveOptions options;
  options.estimate_time_offsets = true;
  options.refine_intrinsics = true;
  options.estimate_marker_positions = true;
  return options;
}

void Whole(benchmark::State& state) {
  const Recording& recording = TheRecording();
  for (auto _ : state) Must(server::Calibrate(recording.input, {}).result);
}
BENCHMARK(Whole)->Unit(benchmark::kMillisecond);

void CoarseSearch(benchmark::State& state) {
  const Recording& recording = TheRecording();
  for (auto _ : state) {
    std::vector<server::ClockCorrection> clocks = recording.clocks;
    Must(server::SearchTimeOffsets(recording.rig, 0, {}, &clocks));
  }
}
BENCHMARK(CoarseSearch)->Unit(benchmark::kMillisecond);

void FineSolve(benchmark::State& state) {
  const Recording& recording = TheRecording();
  for (auto _ : state) {
    const server::RigSolution solution =
        Must(server::SolveRig(recording.rig, recording.searched, Everything()));
    Must(server::ComputeUncertainty(solution, Everything()));
    state.counters["iterations"] = solution.iterations;
  }
}
BENCHMARK(FineSolve)->Unit(benchmark::kMillisecond);

void Adjustment(benchmark::State& state) {
  const Recording& recording = TheRecording();
  server::BundleProblem start = recording.solved;
  for (server::BundleCamera& camera : start.cameras) {
    if (!camera.intrinsics_fixed) camera.intrinsics = camera.intrinsics_mean;
  }
  for (server::BundleClock& clock : start.clocks) clock.time_offset_s = 0;
  for (auto _ : state) {
    server::BundleProblem problem = start;
    state.counters["iterations"] = Must(server::SolveLineBundle({}, &problem)).iterations;
  }
}
BENCHMARK(Adjustment)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace rigcal::testing

BENCHMARK_MAIN();
