// SPDX-License-Identifier: Apache-2.0
// Disturbed recordings, over many seeds and on the real recording: is the cause named, is another
// one named, and is any result graded better than it is.
#include <fmt/core.h>

#include <map>
#include <string>
#include <vector>

#include "common/statistics/robust_statistics.h"
#include "tests/accuracy/seed_options.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/doctor_experiment.h"
#include "tests/accuracy/solver/solver_experiments.h"

namespace rigcal::accuracy {
namespace {

constexpr double kMinNamed = 0.95, kMaxWrong = 0.02, kMaxAlarms = 0.01;

struct Counts {
  int runs = 0, named = 0, wrong = 0, refused = 0, good = 0, usable = 0, bad = 0;
  int falsely_good = 0, falsely_usable = 0;
  std::map<std::string, int> wrong_names;
  std::vector<double> error_rel;
  std::map<FindingKind, int> kinds;  // runs that named them
  double cpu_s = 0;
};

struct CountedCase {
  std::string name;
  bool has_cause = false;
  Counts counts;
};

void Count(const Diagnosis& diagnosis, Counts* counts) {
  ++counts->runs;
  counts->named += diagnosis.named ? 1 : 0;
  counts->wrong += diagnosis.wrong.empty() ? 0 : 1;
  for (const std::string& name : diagnosis.wrong) ++counts->wrong_names[name];
  for (const FindingKind kind : diagnosis.kinds) ++counts->kinds[kind];
  counts->cpu_s += diagnosis.cpu_s;
  if (!diagnosis.status.ok()) {
    ++counts->refused;
    return;
  }
  counts->good += diagnosis.grade == QualityGrade::kGood ? 1 : 0;
  counts->usable += diagnosis.grade == QualityGrade::kUsable ? 1 : 0;
  counts->bad += diagnosis.grade == QualityGrade::kBad ? 1 : 0;
  counts->falsely_good += diagnosis.falsely_good ? 1 : 0;
  counts->falsely_usable += diagnosis.falsely_usable ? 1 : 0;
  counts->error_rel.push_back(diagnosis.error_rel);
}

void PrintHeader() {
  fmt::print("{:30} {:>4} {:>5} {:>5} {:>7} {:>4} {:>6} {:>4} {:>8} {:>6} {:>5} {:>6}\n", "",
             "runs", "named", "wrong", "refused", "good", "usable", "bad", "error %", "f.good",
             "f.us.", "cpu s");
}

void PrintCounts(const std::string& name, const Counts& counts) {
  std::string error = "-";
  if (!counts.error_rel.empty()) {
    error = fmt::format("{:.3f}", 100 * InterpolatedQuantile(counts.error_rel, 0.5));
  }
  fmt::print("{:30} {:4} {:5} {:5} {:7} {:4} {:6} {:4} {:>8} {:6} {:5} {:6.1f}", name, counts.runs,
             counts.named, counts.wrong, counts.refused, counts.good, counts.usable, counts.bad,
             error, counts.falsely_good, counts.falsely_usable, counts.cpu_s / counts.runs);
  for (const auto& [wrong, count] : counts.wrong_names) fmt::print("  {} x{}", wrong, count);
  fmt::print("\n");
  std::fflush(stdout);
}

void PrintText(const std::string& name, const Diagnosis& diagnosis) {
  fmt::print("  {}: error {:.3f} mm, {:.3f} %, {:.1f} sigmas\n", name, 1e3 * diagnosis.error_m,
             100 * diagnosis.error_rel, diagnosis.sigmas);
  for (const std::string& line : diagnosis.text) fmt::print("    {}\n", line);
}

// Which causes were named (columns) under which disturbance (rows), in how many runs.
void PrintConfusion(const std::vector<CountedCase>& cases) {
  std::map<FindingKind, int> columns;
  for (const CountedCase& counted : cases) {
    for (const auto& [kind, count] : counted.counts.kinds) columns[kind] = 0;
  }
  fmt::print("\nconfusion matrix: runs that named each cause\n");
  int number = 0;
  for (auto& [kind, column] : columns) {
    column = ++number;
    fmt::print("  {}: {}\n", column, NameOf(kind));
  }
  fmt::print("{:44} {:>4}", "", "runs");
  for (const auto& [kind, column] : columns) fmt::print(" {:>3}", column);
  fmt::print("  refused\n");
  for (const CountedCase& counted : cases) {
    fmt::print("{:44} {:4}", counted.name, counted.counts.runs);
    for (const auto& [kind, column] : columns) {
      const auto found = counted.counts.kinds.find(kind);
      fmt::print(" {:>3}",
                 found == counted.counts.kinds.end() ? "." : std::to_string(found->second));
    }
    fmt::print("  {:>7}\n", counted.counts.refused);
  }
}

// True where the limits hold.
bool PrintTotals(const std::vector<CountedCase>& cases) {
  int disturbed = 0, named = 0, all = 0, wrong = 0, clean = 0, alarms = 0, falsely_good = 0;
  for (const CountedCase& counted : cases) {
    falsely_good += counted.counts.falsely_good;
    all += counted.counts.runs;
    wrong += counted.counts.wrong;
    if (counted.name.starts_with("clean")) {
      clean += counted.counts.runs;
      alarms += counted.counts.wrong;
    }
    if (!counted.has_cause) continue;
    disturbed += counted.counts.runs;
    named += counted.counts.named;
  }
  fmt::print(
      "\ncause named: {} of {}; wrong cause: {} of {}; false alarm: {} of {} clean runs\n"
      "graded good with an error above 1 % of the distance or 3 stated sigmas: {}\n",
      named, disturbed, wrong, all, alarms, clean, falsely_good);
  return named >= kMinNamed * disturbed && wrong <= kMaxWrong * all &&
         alarms <= kMaxAlarms * clean && falsely_good == 0;
}

int RunDoctor(const SeedOptions& seeds) {
  fmt::print("{} cameras, {} s at 25 Hz, 0.3 px, all defaults; 'real' is the real recording\n",
             seeds.camera_count, seeds.duration_s);
  PrintHeader();
  const absl::StatusOr<DoctorPatient> recorded = RecordedPatient();
  if (!recorded.ok()) fmt::print("real: {}\n", recorded.status().ToString());
  std::vector<CountedCase> cases;
  for (const Disturbance& disturbance : AllDisturbances()) {
    if (!seeds.only.empty() && disturbance.name.find(seeds.only) == std::string::npos) continue;
    const auto trials = RunAll<Diagnosis>(seeds.count, seeds.threads, [&](int i) {
      const auto seed = static_cast<uint32_t>(seeds.first + i);
      const auto patient = SimulatedPatient(seed, seeds.camera_count, seeds.duration_s);
      if (patient.ok()) return Diagnose(disturbance, *patient, seed);
      Diagnosis none;
      none.status = patient.status();
      return none;
    });
    Counts counts;
    for (const Diagnosis& trial : trials) Count(trial, &counts);
    PrintCounts(disturbance.name, counts);
    const bool has_cause = !disturbance.causes.empty() || !disturbance.message.empty();
    cases.push_back({disturbance.name, has_cause, counts});
    if (seeds.verbose) {
      for (size_t i = 0; i < trials.size(); ++i) {
        PrintText(fmt::format("seed {}", seeds.first + static_cast<int>(i)), trials[i]);
      }
    }
    if (!recorded.ok() || disturbance.of_simulation) continue;
    const Diagnosis real = Diagnose(disturbance, *recorded, 1);
    Counts of_real;
    Count(real, &of_real);
    PrintCounts("  real", of_real);
    cases.push_back({disturbance.name + ", real", has_cause, of_real});
    if (seeds.verbose) PrintText("real", real);
  }
  PrintConfusion(cases);
  return PrintTotals(cases) ? 0 : 1;
}

}  // namespace

Experiment Doctor() {
  SeedOptions defaults;
  defaults.count = 20;
  return SeedExperiment("doctor", "are the causes of disturbed recordings named, and graded so",
                        defaults, RunDoctor);
}

}  // namespace rigcal::accuracy
