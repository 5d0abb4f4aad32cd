// SPDX-License-Identifier: Apache-2.0
// When a session may end: by the expected error of the running estimate, or by a count of views;
// and what following the advice is worth. Rigs of 6 to 12 cameras, and the real recording.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <vector>

#include "common/statistics/robust_statistics.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/solver_experiments.h"
#include "tests/accuracy/solver/until_mm_experiment.h"
#include "tests/server/solve/recorded_input.h"
#include "tests/testing/recorded_data.h"

namespace rigcal::accuracy {
namespace {

constexpr double kFramesPerS = 50;
constexpr int kUsualViews = 1000;          // of the poorest camera: Vicon's count
constexpr double kRecordingMm[] = {3, 2};  // the recording is short

struct UntilSettings {
  int count = 20;
  int first = 1;
  int threads = 2;
  int camera_count = 0;  // 0: 6 to 12
  double duration_s = 120;
  double until_mm = 0.5;
  double lens_error = 0;
  bool verbose = false;
};

UntilOptions OptionsOf(const UntilSettings& settings, int index, bool guided) {
  UntilOptions options;
  options.camera_count =
      settings.camera_count > 0 ? settings.camera_count : 6 + (settings.first + index) % 7;
  options.duration_s = settings.duration_s;
  options.until_mm = settings.until_mm;
  options.lens_error = settings.lens_error;
  options.guided = guided;
  options.end_views = guided ? 0 : kUsualViews;
  return options;
}

const UntilStep* StepAt(const UntilTrial& trial, int step) {
  return step < 0 ? nullptr : &trial.steps[static_cast<size_t>(step)];
}

std::string Columns(const UntilStep* step) {
  if (step == nullptr) return fmt::format("{:>7} {:>7} {:>7}", "-", "-", "-");
  return fmt::format("{:7.0f} {:7.2f} {:7.2f}", kFramesPerS * step->time_s, step->predicted_mm,
                     step->true_mm);
}

void PrintSteps(const UntilTrial& trial) {
  for (const UntilStep& step : trial.steps) {
    fmt::print("   {:5.0f} s: {:5} views, stated {:7.3f} mm, true {:7.3f} mm, {} {:.2f} s\n",
               step.time_s, step.poorest_views, step.predicted_mm, step.true_mm,
               step.agrees ? "agrees   " : "disagrees", step.solve_s);
  }
}

double Median(std::vector<double> values) {
  return values.empty() ? NAN : InterpolatedQuantile(values, 0.5);
}

// What the trials come to.
class UntilSummary {
 public:
  explicit UntilSummary(double until_mm) : until_mm_(until_mm) {}

  // Trials that do not reach the target count as long as they went on.
  void Add(const UntilTrial& random, const UntilTrial& guided) {
    ++count_;
    const UntilStep* const stop = StepAt(random, random.StopAt(until_mm_));
    const UntilStep* const usual = StepAt(random, random.StepWithViews(kUsualViews));
    const UntilStep* const told = StepAt(guided, guided.StopAt(until_mm_));
    if (stop != nullptr) {
      ++stopped_;
      below_ += stop->true_mm < until_mm_ ? 1 : 0;
      calibrated_ += random.calibrated_mm < until_mm_ ? 1 : 0;
      if (usual != nullptr) of_usual_.push_back(stop->time_s / usual->time_s);
    }
    if (told != nullptr) {
      ++told_stopped_;
      told_below_ += told->true_mm < until_mm_ ? 1 : 0;
    }
    if (!random.steps.empty() && !guided.steps.empty()) {
      const auto time_s = [](const UntilStep* reached, const UntilTrial& trial) {
        return (reached != nullptr ? *reached : trial.steps.back()).time_s;
      };
      random_s_.push_back(time_s(stop, random));
      told_s_.push_back(time_s(told, guided));
      of_random_.push_back(told_s_.back() / random_s_.back());
    }
    for (const UntilStep& step : random.steps) {
      solve_s_.push_back(step.solve_s);
      if (step.predicted_mm > 0 && step.agrees) {
        of_stated_.push_back(step.true_mm / step.predicted_mm);
      }
    }
  }

  void Print() const {
    fmt::print(
        "\nwaving anywhere: stopped {} of {}; true error below the target in {}, that of a "
        "calibration in {}\n",
        stopped_, count_, below_, calibrated_);
    fmt::print("following advice: stopped {} of {}; true error below the target in {}\n",
               told_stopped_, count_, told_below_);
    if (of_stated_.empty()) return;
    fmt::print("true / stated error: median {:.2f}, 95 % {:.2f}\n", Median(of_stated_),
               InterpolatedQuantile(of_stated_, 0.95));
    fmt::print(
        "frames until the target, of those until {} views of the poorest camera: median "
        "{:.2f}\n",
        kUsualViews, Median(of_usual_));
    const double random_s = std::accumulate(random_s_.begin(), random_s_.end(), 0.0);
    const double told_s = std::accumulate(told_s_.begin(), told_s_.end(), 0.0);
    fmt::print(
        "time until the target with advice, of that without: median {:.2f}; all rigs together "
        "{:.2f} ({:.0f} s of {:.0f} s)\n",
        Median(of_random_), told_s / random_s, told_s, random_s);
    fmt::print("CPU time of an estimate without advice: median {:.2f} s, 95 % {:.2f} s\n",
               Median(solve_s_), InterpolatedQuantile(solve_s_, 0.95));
  }

 private:
  const double until_mm_;
  int count_ = 0, stopped_ = 0, below_ = 0, calibrated_ = 0, told_stopped_ = 0, told_below_ = 0;
  std::vector<double> of_usual_, of_random_, of_stated_, random_s_, told_s_, solve_s_;
};

bool RunSimulated(const UntilSettings& settings) {
  const auto run = [&](bool guided) {
    return RunAll<UntilTrial>(settings.count, settings.threads, [&](int i) {
      return RunUntilTrial(OptionsOf(settings, i, guided),
                           static_cast<uint32_t>(settings.first + i));
    });
  };
  const std::vector<UntilTrial> random = run(false), guided = run(true);
  fmt::print(
      "until {} mm in 95 % of the volume; frames of each camera ({} Hz), stated and true error in "
      "mm\n                waving anywhere        {} views of poorest   following advice\n"
      "seed cameras  frames  stated    true  frames  stated    true  frames  stated    true  "
      "calibrated\n",
      settings.until_mm, kFramesPerS, kUsualViews);
  UntilSummary summary(settings.until_mm);
  bool ok = true;
  for (int i = 0; i < settings.count; ++i) {
    const UntilTrial& trial = random[static_cast<size_t>(i)];
    const UntilTrial& told = guided[static_cast<size_t>(i)];
    for (const absl::Status& status : {trial.status, told.status}) {
      if (status.ok()) continue;
      fmt::print("{:4} {}\n", settings.first + i, status.ToString());
      ok = false;
    }
    fmt::print("{:4} {:7} {} {} {} {:11.2f}\n", settings.first + i,
               OptionsOf(settings, i, false).camera_count,
               Columns(StepAt(trial, trial.StopAt(settings.until_mm))),
               Columns(StepAt(trial, trial.StepWithViews(kUsualViews))),
               Columns(StepAt(told, told.StopAt(settings.until_mm))), trial.calibrated_mm);
    if (settings.verbose) {
      PrintSteps(trial);
      fmt::print("   following advice\n");
      PrintSteps(told);
    }
    summary.Add(trial, told);
  }
  summary.Print();
  return ok;
}

bool ReplayEwand(const UntilSettings& settings) {
  const auto data = testing::RecordedDataDirectory();
  if (!data) {
    fmt::print("\nno real recording (set RIGCAL_TEST_DATA)\n");
    return true;
  }
  const auto recording = server::RecordedInput(*data);
  if (!recording.ok()) {
    fmt::print("\n{}\n", recording.status().ToString());
    return false;
  }
  const auto trial = ReplayRecording(*recording, settings.until_mm);
  if (!trial.ok()) {
    fmt::print("\n{}\n", trial.status().ToString());
    return false;
  }
  fmt::print("\nthe real recording at its own speed ({} views of its poorest camera in all)\n",
             trial->steps.back().poorest_views);
  std::vector<double> targets_mm(std::begin(kRecordingMm), std::end(kRecordingMm));
  targets_mm.push_back(settings.until_mm);
  for (const double target_mm : targets_mm) {
    const UntilStep* const stop = StepAt(*trial, trial->StopAt(target_mm));
    if (stop == nullptr) {
      fmt::print("{:5.2f} mm: not reached; stated {:.2f} mm at the end\n", target_mm,
                 trial->steps.back().predicted_mm);
      continue;
    }
    fmt::print(
        "{:5.2f} mm: after {:.0f} s, {} views of the poorest camera; stated {:.2f} mm, {:.2f} mm "
        "from the calibration of all of it\n",
        target_mm, stop->time_s, stop->poorest_views, stop->predicted_mm, stop->true_mm);
  }
  if (settings.verbose) PrintSteps(*trial);
  return true;
}

}  // namespace

Experiment UntilMm() {
  return {"until_mm", "ending a session by its expected error",
          [](OptionList* options) -> Experiment::Run {
            const auto settings = std::make_shared<UntilSettings>();
            options->Add("--seeds", &settings->count, 0, 100'000, "number of simulated rigs");
            options->Add("--first-seed", &settings->first, 0, 1 << 30, "lowest seed");
            options->Add("--threads", &settings->threads, 1, 256, "rigs at the same time");
            options->Add("--cameras", &settings->camera_count, 0, 100, "of each rig; 0: 6 to 12");
            options->Add("--duration", &settings->duration_s, 2, 3600, "seconds of waving at most");
            options->Add("--until-mm", &settings->until_mm, 0.01, 1000, "the target");
            options->Add("--lens-error", &settings->lens_error, 0, 100,
                         "of the described lenses: 1 is 0.2 % of the focal length");
            options->AddFlag("--verbose", &settings->verbose, "print every estimate");
            return [settings] {
              const bool simulated = RunSimulated(*settings);
              return ReplayEwand(*settings) && simulated ? 0 : 1;
            };
          }};
}

}  // namespace rigcal::accuracy
