// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/flight_experiment.h"

#include <algorithm>
#include <ctime>
#include <utility>

#include "common/status/status_macros.h"
#include "server/solve/calibrate.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "tests/server/solve/recorded_input.h"

namespace rigcal::accuracy {
namespace {

constexpr double kRtkHz = 5;

double FlightCpuS() {
  timespec now = {};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// Where at least two cameras place the point.
std::vector<TimedPosition> PathOf(const server::RigSolution& solution) {
  const server::BundleProblem& problem = solution.built.problem;
  std::vector<TimedPosition> path;
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    int views = 0;
    ForEachUsedMarker(problem, problem.instants[i],
                      [&views](const auto&, const auto&) { ++views; });
    if (views < 2) continue;
    path.push_back({1e-9 * static_cast<double>(solution.built.instant_time_ns[i]),
                    problem.instants[i].origin_m});
  }
  std::ranges::stable_sort(path, {}, &TimedPosition::time_s);
  return path;
}

absl::StatusOr<FlightRun> Fly(server::CalibrationInput input, const ReferencePath& truth,
                              const CalibrationOptions& options) {
  FlightRun run;
  server::CalibrationHooks hooks;
  hooks.solved = [&run](const server::RigObservations&, const server::RigSolution& solution) {
    run.path = PathOf(solution);
  };
  const double before_s = FlightCpuS();
  server::CalibrationOutcome outcome = server::Calibrate(std::move(input), options, hooks);
  run.cpu_s = FlightCpuS() - before_s;
  RIGCAL_RETURN_IF_ERROR(outcome.result.status());
  run.result = *std::move(outcome.result);
  RIGCAL_ASSIGN_OR_RETURN(run.errors, ComparePaths(run.path, truth));
  return run;
}

}  // namespace

absl::StatusOr<FlightRun> RunFlight(const std::filesystem::path& data,
                                    const CalibrationOptions& options) {
  RIGCAL_ASSIGN_OR_RETURN(server::CalibrationInput input, server::RecordedFlight(data));
  RIGCAL_ASSIGN_OR_RETURN(const ReferencePath rtk,
                          LoadReferencePath(data / "flight" / "trajectory_rtk.txt", kRtkHz));
  return Fly(std::move(input), rtk, options);
}

absl::StatusOr<FlightRun> RunSimulatedFlight(const server::SimulatedFlight& flight,
                                             const CalibrationOptions& options) {
  return Fly(flight.input, {flight.path_hz, flight.path_m}, options);
}

}  // namespace rigcal::accuracy
