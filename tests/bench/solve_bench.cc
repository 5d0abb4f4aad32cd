// SPDX-License-Identifier: Apache-2.0
// The line bundle against the plain reference (reference_bundle.h) and against Ceres with analytic
// derivatives and DENSE_SCHUR, one thread (OMP_THREAD_LIMIT=1). Time is that of one iteration.
// Counters: ms per iteration of each (ms, analytic_ms, plain_ms), speed relative to each
// (vs_analytic, vs_plain), iterations, and how much lower the cost of the reference is, relative
// (excess; must be below 1e-9). With more than 24 cameras the reference is timed over three
// iterations and then started at the line bundle's optimum.
#include <benchmark/benchmark.h>
#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/solve/bundle/bundle_adjuster.h"
#include "server/solve/bundle/line_bundle.h"
#include "server/solve/bundle/line_bundle_kernel.h"
#include "server/solve/bundle/line_bundle_system.h"
#include "tests/bench/must.h"
#include "tests/bench/reference_bundle.h"
#include "tests/bench/suites.h"
#include "tests/testing/bundle_scene.h"

namespace rigcal::testing::solve_bench {
namespace {

using bench::Must;
using server::BundleOptions;
using server::BundleProblem;
using server::BundleSummary;

constexpr int kMaxCamerasOfWholeReference = 24;
constexpr int kTimedIterations = 3;

BundleScene MakeScene(int cameras, int instants, bool everything) {
  BundleSceneOptions options;
  options.camera_count = cameras;
  options.instant_count = instants;
  options.outlier_share = 0.02;
  options.dropout_share = 0.05;
  options.free_spacing = true;
  options.free_intrinsics = everything;
  options.free_rates = everything;
  return MakeBundleScene(options);
}

double PerIteration(double seconds, const BundleSummary& summary) {
  return seconds / std::max(1, summary.iterations);
}

using SolveFunction = absl::StatusOr<BundleSummary> (*)(const BundleOptions&, BundleProblem*);

// Without preparation: from a short and a long run.
double SecondsPerIteration(SolveFunction solve, const BundleOptions& options,
                           const BundleProblem& start) {
  double seconds[2];
  int iterations[2];
  for (int run = 0; run < 2; ++run) {
    BundleProblem problem = start;
    BundleOptions limited = options;
    if (run == 0) limited.max_iterations = 1;
    const auto begin = std::chrono::steady_clock::now();
    iterations[run] = Must(solve(limited, &problem)).iterations;
    seconds[run] = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }
  return (seconds[1] - seconds[0]) / std::max(1, iterations[1] - iterations[0]);
}

void RunAgainstReference(benchmark::State& state, bool everything) {
  const int cameras = static_cast<int>(state.range(0));
  const BundleScene scene = MakeScene(cameras, static_cast<int>(state.range(1)), everything);
  const bool whole = cameras <= kMaxCamerasOfWholeReference;
  const BundleOptions options;
  BundleOptions timed = options;
  if (!whole) timed.max_iterations = kTimedIterations;
  for (auto _ : state) {
    BundleProblem solved = scene.initial;
    const BundleSummary line = Must(server::SolveLineBundle(options, &solved));
    const double line_s = SecondsPerIteration(server::SolveLineBundle, options, scene.initial);
    const double analytic_s = SecondsPerIteration(server::SolveBundle, timed, scene.initial);
    state.SetIterationTime(line_s);
    state.counters["ms"] = 1e3 * line_s;
    state.counters["iterations"] = line.iterations;
    double plain_s = 0;
    BundleProblem problem = scene.initial;
    BundleSummary summary = Must(SolveReferenceBundle(timed, &problem, &plain_s));
    plain_s = PerIteration(plain_s, summary);
    if (!whole) {
      problem = solved;
      summary = Must(SolveReferenceBundle(timed, &problem));
    }
    state.counters["analytic_ms"] = 1e3 * analytic_s;
    state.counters["plain_ms"] = 1e3 * plain_s;
    state.counters["vs_analytic"] = analytic_s / line_s;
    state.counters["vs_plain"] = plain_s / line_s;
    state.counters["excess"] = (line.final_cost - summary.final_cost) / summary.final_cost;
    if (!line.converged) state.SkipWithError("not converged");
  }
}

void PosesOffsetsSpacing(benchmark::State& state) { RunAgainstReference(state, false); }

void Everything(benchmark::State& state) { RunAgainstReference(state, true); }

// One iteration with one instruction set of this CPU.
void Iteration(benchmark::State& state, const server::LineBundleKernel* kernel, int cameras,
               int instants) {
  const BundleScene scene = MakeScene(cameras, instants, false);
  const BundleOptions options;
  const server::LineBundleLayout layout = server::LayOut(scene.initial);
  const server::PackedMarkers packed = server::Pack(scene.initial, layout);
  server::LineBundleSystem system(options, layout, packed, *kernel);
  const server::LineBundleEstimate estimate(scene.initial, layout, packed);
  server::LineBundleEstimate moved(scene.initial, layout, packed);
  for (auto _ : state) {
    if (!system.Linearise(estimate, 1e-4, false) || !system.Solve(estimate, &moved).valid)
      std::exit(1);
  }
}

// Kilobytes of a field of /proc/self/status.
double StatusKb(const std::string& field) {
  std::ifstream status("/proc/self/status");
  std::string word;
  double value = 0;
  while (status >> word) {
    if (word == field + ":") status >> value;
  }
  return value;
}

// Peak memory of the solver, and the size of the problem itself.
void Memory(benchmark::State& state) {
  const BundleScene scene =
      MakeScene(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)), true);
  for (auto _ : state) {
    BundleProblem problem = scene.initial;
    malloc_trim(0);  // memory freed by former benchmarks
    const double before_kb = StatusKb("VmRSS");
    std::ofstream("/proc/self/clear_refs") << "5";  // resets the peak
    const auto begin = std::chrono::steady_clock::now();
    const BundleSummary summary = Must(server::SolveLineBundle({}, &problem));
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
    state.SetIterationTime(PerIteration(seconds.count(), summary));
    state.counters["solver_mb"] = (StatusKb("VmHWM") - before_kb) / 1024;
    state.counters["problem_mb"] =
        static_cast<double>(problem.markers.size() * sizeof(server::BundleMarker) +
                            problem.observations.size() * sizeof(server::BundleObservation) +
                            problem.instants.size() * sizeof(server::BundleInstant)) /
        (1024 * 1024);
  }
}

void RegisterIterations() {
  for (const server::LineBundleKernel* kernel : server::AvailableLineBundleKernels()) {
    for (const auto& [cameras, instants] : {std::pair(6, 1000), {24, 1000}, {100, 1000}}) {
      const std::string name = absl::StrCat("solve/Iteration/", kernel->name, "/cameras:", cameras,
                                            "/instants:", instants);
      benchmark::RegisterBenchmark(name.c_str(), Iteration, kernel, cameras, instants)
          ->Unit(benchmark::kMillisecond);
    }
  }
}

void RegisterWhole(const char* name, void (*run)(benchmark::State&),
                   const std::vector<std::vector<int64_t>>& sizes) {
  auto* const registered = benchmark::RegisterBenchmark(name, run);
  for (const std::vector<int64_t>& size : sizes) registered->Args(size);
  registered->ArgNames({"cameras", "instants"})
      ->UseManualTime()
      ->Iterations(1)
      ->Unit(benchmark::kMillisecond);
}

void Register() {
  RegisterWhole("solve/PosesOffsetsSpacing", PosesOffsetsSpacing,
                {{4, 614}, {6, 1000}, {6, 5000}, {24, 1000}, {24, 5000}, {100, 1000}, {100, 5000}});
  RegisterWhole("solve/Everything", Everything, {{6, 1000}, {24, 1000}});
  RegisterWhole("solve/Memory", Memory, {{24, 20000}});
  RegisterIterations();
}

}  // namespace
}  // namespace rigcal::testing::solve_bench

namespace rigcal::bench {

Suite SolveSuite() {
  return {"solve", "one iteration of the solver, against automatic differentiation in Ceres",
          testing::solve_bench::Register};
}

}  // namespace rigcal::bench
