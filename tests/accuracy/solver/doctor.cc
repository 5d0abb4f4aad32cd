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

struct Counts {
  int runs = 0, named = 0, wrong = 0, refused = 0, good = 0, usable = 0, bad = 0;
  int falsely_good = 0, falsely_usable = 0;
  std::map<std::string, int> wrong_names;
  std::vector<double> error_rel;
};

void Count(const Diagnosis& diagnosis, Counts* counts) {
  ++counts->runs;
  counts->named += diagnosis.named ? 1 : 0;
  counts->wrong += diagnosis.wrong.empty() ? 0 : 1;
  for (const std::string& name : diagnosis.wrong) ++counts->wrong_names[name];
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
  fmt::print("{:26} {:>4} {:>5} {:>5} {:>7} {:>4} {:>6} {:>4} {:>10} {:>6} {:>6}\n", "", "runs",
             "named", "wrong", "refused", "good", "usable", "bad", "error %", "f.good", "f.us.");
}

void PrintCounts(const std::string& name, const Counts& counts) {
  std::string error = "-";
  if (!counts.error_rel.empty()) {
    error = fmt::format("{:.3f}", 100 * InterpolatedQuantile(counts.error_rel, 0.5));
  }
  fmt::print("{:26} {:4} {:5} {:5} {:7} {:4} {:6} {:4} {:>10} {:6} {:6}", name, counts.runs,
             counts.named, counts.wrong, counts.refused, counts.good, counts.usable, counts.bad,
             error, counts.falsely_good, counts.falsely_usable);
  for (const auto& [wrong, count] : counts.wrong_names) fmt::print("  {} x{}", wrong, count);
  fmt::print("\n");
  std::fflush(stdout);
}

void PrintText(const std::string& name, const Diagnosis& diagnosis) {
  fmt::print("  {}: error {:.3f} mm, {:.3f} %, {:.1f} sigmas\n", name, 1e3 * diagnosis.error_m,
             100 * diagnosis.error_rel, diagnosis.sigmas);
  for (const std::string& line : diagnosis.text) fmt::print("    {}\n", line);
}

int RunDoctor(const SeedOptions& seeds) {
  fmt::print("{} cameras, {} s at 25 Hz, 0.3 px, all defaults; 'real' is the real recording\n",
             seeds.camera_count, seeds.duration_s);
  PrintHeader();
  const absl::StatusOr<DoctorPatient> recorded = RecordedPatient();
  if (!recorded.ok()) fmt::print("real: {}\n", recorded.status().ToString());
  int falsely_good = 0;
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
    falsely_good += counts.falsely_good;
    if (seeds.verbose) {
      for (size_t i = 0; i < trials.size(); ++i) {
        PrintText(fmt::format("seed {}", seeds.first + static_cast<int>(i)), trials[i]);
      }
    }
    if (!recorded.ok()) continue;
    const Diagnosis real = Diagnose(disturbance, *recorded, 1);
    Counts of_real;
    Count(real, &of_real);
    PrintCounts("  real", of_real);
    falsely_good += of_real.falsely_good;
    if (seeds.verbose) PrintText("real", real);
  }
  fmt::print("graded good with an error above 1 % of the distance or 3 stated sigmas: {}\n",
             falsely_good);
  return falsely_good == 0 ? 0 : 1;
}

}  // namespace

Experiment Doctor() {
  SeedOptions defaults;
  defaults.count = 20;
  return SeedExperiment("doctor", "are the causes of disturbed recordings named, and graded so",
                        defaults, RunDoctor);
}

}  // namespace rigcal::accuracy
