// SPDX-License-Identifier: Apache-2.0
// The line bundle against the plain reference (reference_bundle.h) and against Ceres with analytic
// derivatives and DENSE_SCHUR, one thread (OMP_THREAD_LIMIT=1). Time is that of one iteration.
// Counters: ms per iteration of each (ms, analytic_ms, plain_ms), speed relative to each
// (vs_analytic, vs_plain), iterations, setup_ms, share of each stage in an iteration (in %), and
// how much lower the cost of the reference is, relative (excess; must be below 1e-9). With more
// than 24 cameras the reference is timed over three iterations and then started at the line
// bundle's optimum. all_threads: ms per iteration on every core; vs_one: speed relative to one;
// same: 1 if both end at the same bits.
#include <benchmark/benchmark.h>
#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <thread>
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
using server::LineBundleTimes;

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

struct LineRun {
  BundleSummary summary;
  LineBundleTimes times;
  BundleProblem problem;
};

LineRun RunLine(const BundleOptions& options, const BundleProblem& start) {
  LineRun run;
  run.problem = start;
  run.summary = Must(server::SolveLineBundle(options, &run.problem, &run.times));
  return run;
}

void ReportLine(const LineRun& run, benchmark::State& state) {
  const LineBundleTimes& times = run.times;
  const double solving_s = times.total_s - times.setup_s;
  state.SetIterationTime(PerIteration(solving_s, run.summary));
  state.counters["ms"] = 1e3 * PerIteration(solving_s, run.summary);
  state.counters["iterations"] = run.summary.iterations;
  state.counters["setup_ms"] = 1e3 * times.setup_s;
  state.counters["linearise"] = 100 * times.linearise_s / solving_s;
  state.counters["eliminate"] = 100 * times.eliminate_s / solving_s;
  state.counters["solve"] = 100 * times.solve_s / solving_s;
  state.counters["step"] = 100 * times.step_s / solving_s;
}

// Of SolveBundle, without its preparation: from a short and a long run.
double AnalyticPerIteration(BundleOptions options, const BundleProblem& start) {
  double seconds[2];
  int iterations[2];
  for (int run = 0; run < 2; ++run) {
    BundleProblem problem = start;
    BundleOptions limited = options;
    if (run == 0) limited.max_iterations = 1;
    const auto begin = std::chrono::steady_clock::now();
    iterations[run] = Must(server::SolveBundle(limited, &problem)).iterations;
    seconds[run] = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }
  return (seconds[1] - seconds[0]) / std::max(1, iterations[1] - iterations[0]);
}

bool SameBits(const BundleProblem& a, const BundleProblem& b) {
  for (size_t c = 0; c < a.cameras.size(); ++c) {
    if (a.cameras[c].cam_from_rig.rotation.coeffs() !=
            b.cameras[c].cam_from_rig.rotation.coeffs() ||
        a.cameras[c].cam_from_rig.translation_m != b.cameras[c].cam_from_rig.translation_m) {
      return false;
    }
  }
  return true;
}

void ReportThreads(const BundleScene& scene, const LineRun& one, benchmark::State& state) {
  BundleOptions options;
  options.threads = static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1u, 64u));
  const LineRun all = RunLine(options, scene.initial);
  const double one_s = PerIteration(one.times.total_s - one.times.setup_s, one.summary);
  const double all_s = PerIteration(all.times.total_s - all.times.setup_s, all.summary);
  state.counters["threads"] = options.threads;
  state.counters["all_threads"] = 1e3 * all_s;
  state.counters["vs_one"] = one_s / all_s;
  state.counters["same"] = SameBits(one.problem, all.problem) ? 1 : 0;
}

void RunAgainstReference(benchmark::State& state, bool everything) {
  const int cameras = static_cast<int>(state.range(0));
  const BundleScene scene = MakeScene(cameras, static_cast<int>(state.range(1)), everything);
  const bool whole = cameras <= kMaxCamerasOfWholeReference;
  const BundleOptions options;
  BundleOptions timed = options;
  if (!whole) timed.max_iterations = kTimedIterations;
  for (auto _ : state) {
    const LineRun run = RunLine(options, scene.initial);
    ReportLine(run, state);
    ReportThreads(scene, run, state);
    const double line_s = PerIteration(run.times.total_s - run.times.setup_s, run.summary);

    const double analytic_s = AnalyticPerIteration(timed, scene.initial);
    double plain_s = 0;
    BundleProblem problem = scene.initial;
    BundleSummary summary = Must(SolveReferenceBundle(timed, &problem, &plain_s));
    plain_s = PerIteration(plain_s, summary);
    if (!whole) {
      problem = run.problem;
      summary = Must(SolveReferenceBundle(timed, &problem));
    }
    state.counters["analytic_ms"] = 1e3 * analytic_s;
    state.counters["plain_ms"] = 1e3 * plain_s;
    state.counters["vs_analytic"] = analytic_s / line_s;
    state.counters["vs_plain"] = plain_s / line_s;
    state.counters["excess"] = (run.summary.final_cost - summary.final_cost) / summary.final_cost;
    if (!run.summary.converged) state.SkipWithError("not converged");
  }
}

void PosesOffsetsSpacing(benchmark::State& state) { RunAgainstReference(state, false); }

void Everything(benchmark::State& state) { RunAgainstReference(state, true); }

// One iteration with one instruction set of this CPU.
void Iteration(benchmark::State& state, const server::LineBundleKernel* kernel, int cameras,
               int instants) {
  const BundleScene scene = MakeScene(cameras, instants, false);
  const BundleOptions options;
  LineBundleTimes times;
  server::LineBundleLayout layout = server::LayOut(scene.initial);
  const server::PackedMarkers packed = server::Pack(scene.initial, &layout);
  server::LineBundleSystem system(options, layout, packed, *kernel, &times);
  const server::LineBundleEstimate estimate(scene.initial, layout, packed);
  server::LineBundleEstimate moved(scene.initial, layout, packed);
  for (auto _ : state) {
    if (!system.Linearise(estimate, 1e-4) || !system.Solve(estimate, &moved).valid) std::exit(1);
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
    LineBundleTimes times;
    const BundleSummary summary = Must(server::SolveLineBundle({}, &problem, &times));
    state.SetIterationTime(PerIteration(times.total_s - times.setup_s, summary));
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
