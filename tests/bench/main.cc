// SPDX-License-Identifier: Apache-2.0
// All benchmarks: rigcal-bench [SUITE...] [--benchmark_filter=REGEX] ... (docs/performance.md).
#include <benchmark/benchmark.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <opencv2/core/utility.hpp>
#include <vector>

#include "common/wire/grpc_locks.h"
#include "tests/bench/suites.h"

namespace rigcal::bench {
namespace {

using ::benchmark::ConsoleReporter;

std::vector<Suite> AllSuites() {
  return {BesideSolveSuite(), CalibrateSuite(), DetectSuite(), EventSuite(), IngestSuite(),
          LiveSuite(),        RecordedSuite(),  SolveSuite(),  SpoolSuite(), StoreSuite()};
}

void PrintHelp() {
  std::printf(
      "rigcal-bench [SUITE...] [FLAGS]\n"
      "Runs the benchmarks of these suites, of all if none is named. Names begin with SUITE/.\n\n");
  for (const Suite& suite : AllSuites()) std::printf("  %-12s %s\n", suite.name, suite.summary);
  std::printf("\n");
  benchmark::PrintDefaultHelp();
}

// The named suites; empty after an error message.
std::vector<Suite> SelectSuites(int argc, char** argv) {
  const std::vector<Suite> all = AllSuites();
  if (argc <= 1) return all;
  std::vector<Suite> selected;
  for (int i = 1; i < argc; ++i) {
    const auto found = std::find_if(all.begin(), all.end(), [&](const Suite& suite) {
      return std::strcmp(suite.name, argv[i]) == 0;
    });
    if (found == all.end()) {
      std::fprintf(stderr, "no suite or flag '%s'; rigcal-bench --help lists them\n", argv[i]);
      return {};
    }
    selected.push_back(*found);
  }
  return selected;
}

// Whether a run has no time: a flag until version 1.7 of the library, a reason from 1.8 on.
template <typename Run>
bool HasNoTime(const Run& run) {
  if constexpr (requires { run.error_occurred; }) {
    return run.error_occurred;
  } else {
    return static_cast<int>(run.skipped) != 0;
  }
}

// The console's table; keeps the times for the ratios below it.
class TimesReporter : public ConsoleReporter {
 public:
  TimesReporter() : ConsoleReporter(isatty(STDOUT_FILENO) != 0 ? OO_ColorTabular : OO_Tabular) {}

  void ReportRuns(const std::vector<Run>& runs) override {
    ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Iteration || HasNoTime(run)) continue;
      times_.Add(run.run_name.function_name, run.GetAdjustedCPUTime());
    }
  }

  const MeasuredTimes& times() const { return times_; }

 private:
  MeasuredTimes times_;
};

// --benchmark_format=json or csv: nothing else may be printed.
bool AsksForTable(int argc, char** argv) {
  return std::none_of(argv + 1, argv + argc, [](const char* argument) {
    return std::strncmp(argument, "--benchmark_format=", 19) == 0 &&
           std::strcmp(argument + 19, "console") != 0;
  });
}

int Run(int argc, char** argv) {
  wire::TakeLocksWithoutChecks();
  spdlog::set_level(spdlog::level::warn);  // agents that are measured say little
  const bool table = AsksForTable(argc, argv);
  benchmark::Initialize(&argc, argv, PrintHelp);
  const std::vector<Suite> suites = SelectSuites(argc, argv);
  if (suites.empty()) return 2;
  cv::setNumThreads(1);
  for (const Suite& suite : suites) suite.register_benchmarks();
  if (!table) return benchmark::RunSpecifiedBenchmarks() > 0 ? 0 : 1;
  TimesReporter reporter;
  if (benchmark::RunSpecifiedBenchmarks(&reporter) == 0) return 1;
  for (const Suite& suite : suites) {
    if (suite.print_ratios != nullptr) suite.print_ratios(reporter.times());
  }
  return 0;
}

}  // namespace
}  // namespace rigcal::bench

int main(int argc, char** argv) { return rigcal::bench::Run(argc, argv); }
