// SPDX-License-Identifier: Apache-2.0
// Fits the weights of the wand's score (agent/identify/wand_score.h): every candidate that the
// detector looks at in rendered rooms is a sample, positive where each of its spheres is where the
// renderer put it. The weights of today are the prior. Other seeds judge the result.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "agent/detect/frame/wand_detector.h"
#include "common/status/status_macros.h"
#include "tests/accuracy/detection/detection_experiments.h"
#include "tests/accuracy/detection/detection_value.h"
#include "tests/accuracy/detection/logistic_fit.h"
#include "tests/accuracy/seed_runs.h"

namespace rigcal::accuracy {
namespace {

using agent::WandFeature;

// Of the prior: rooms that nobody has rendered are other ones. One sigma of the bias, of a weight
// as a share of it, and of what a feature costs at its most.
constexpr double kBiasSigma = 1, kWeightSigma = 0.5, kLeastCostSigma = 1;
constexpr double kFixed = 1e-6;

struct FitArguments {
  int first_seed = 31, seeds = 2, judged_seeds = 1, threads = 2;
  double duration_s = 10;
  std::string output;
};

// Candidates of the dark rooms, and of the lit ones.
using Samples = std::array<std::vector<LogisticSample>, 2>;

LogisticSample SampleOf(const agent::VerifiedWand& wand) {
  LogisticSample sample{.doubts = Eigen::VectorXd(agent::kWandFeatureCount)};
  for (size_t k = 0; k < agent::kWandFeatureCount; ++k) {
    const auto feature = static_cast<WandFeature>(k);
    sample.doubts[static_cast<Eigen::Index>(k)] =
        std::min(wand.features[feature], agent::WeightOf(feature).most);
  }
  return sample;
}

double WorstPx(const agent::VerifiedWand& wand, const FrameGroundTruth& truth, bool flipped) {
  double worst_px = truth.markers.empty() ? 2 * kFalsePx : 0;
  const size_t count = truth.markers.size();
  for (size_t m = 0; m < count; ++m) {
    const Eigen::Vector2d true_px = truth.markers[flipped ? count - 1 - m : m].centre_px;
    worst_px = std::max(worst_px, (wand.centres[m].centre_px - true_px).norm());
  }
  return worst_px;
}

void AddTrials(const std::vector<agent::WandTrial>& trials, const FrameGroundTruth& truth,
               Samples* samples) {
  for (const agent::WandTrial& trial : trials) {
    if (!trial.refusal.empty()) continue;
    LogisticSample sample = SampleOf(trial.wand);
    sample.is_positive = WorstPx(trial.wand, truth, false) < kFalsePx;
    // The same spheres the other way round are no rival, nor are other pieces of them.
    const double same_px = std::max(kFalsePx, trial.wand.centres.front().radius_px);
    if (!sample.is_positive && (WorstPx(trial.wand, truth, false) < same_px ||
                                WorstPx(trial.wand, truth, true) < same_px)) {
      continue;
    }
    (*samples)[trial.is_lit ? 1 : 0].push_back(std::move(sample));
  }
}

absl::StatusOr<Samples> CollectCamera(const RoomWave& wave, int number) {
  RIGCAL_ASSIGN_OR_RETURN(FrameRenderer renderer,
                          FrameRenderer::Create(wave.world, number, wave.render));
  const CameraDescription& camera = wave.world->cameras()[static_cast<size_t>(number)].description;
  agent::WandDetectorOptions options;
  options.exposure_s = wave.render.exposure_s;
  RIGCAL_ASSIGN_OR_RETURN(agent::WandDetector detector,
                          agent::WandDetector::Create(options, wave.world->target(), camera));
  std::vector<uint8_t> pixels(renderer.buffer_size());
  const ImageSize size = camera.image_size_px;
  const agent::ImageView image{pixels.data(), static_cast<int>(size.width),
                               static_cast<int>(size.height),
                               static_cast<ptrdiff_t>(size.width) * 3, agent::PixelFormat::kBgr8};
  Samples samples;
  for (int i = 0; i < wave.world->FrameCount(number); ++i) {
    RIGCAL_ASSIGN_OR_RETURN(const FrameGroundTruth truth, renderer.Render(i, pixels));
    // As single pictures: what a static background hides would be no sample.
    RIGCAL_ASSIGN_OR_RETURN(const agent::WandExplanation explanation, detector.Explain(image));
    AddTrials(explanation.trials, truth, &samples);
  }
  return samples;
}

absl::StatusOr<Samples> Collect(const FitArguments& arguments, int first_seed, int count) {
  Samples all;
  for (int seed = first_seed; seed < first_seed + count; ++seed) {
    for (const DetectionCase& room : ValueRooms()) {
      DetectionValueOptions options;
      options.seed = static_cast<uint32_t>(seed);
      options.duration_s = arguments.duration_s;
      RIGCAL_ASSIGN_OR_RETURN(const RoomWave wave, MakeRoomWave(options, room));
      struct CameraRun {
        absl::StatusOr<Samples> samples = absl::UnknownError("not run");
      };
      auto cameras = RunAll<CameraRun>(options.camera_count, arguments.threads,
                                       [&](int c) { return CameraRun{CollectCamera(wave, c)}; });
      for (CameraRun& camera : cameras) {
        RIGCAL_RETURN_IF_ERROR(camera.samples.status());
        for (size_t light = 0; light < all.size(); ++light) {
          std::ranges::move((*camera.samples)[light], std::back_inserter(all[light]));
        }
      }
    }
  }
  return all;
}

LogisticModel TodaysModel(bool is_lit) {
  LogisticModel model{.bias = agent::MostLogOdds(is_lit),
                      .weights = Eigen::VectorXd(agent::kWandFeatureCount)};
  for (size_t k = 0; k < agent::kWandFeatureCount; ++k) {
    const agent::WandWeight& weight = agent::WeightOf(static_cast<WandFeature>(k));
    model.weights[static_cast<Eigen::Index>(k)] = is_lit ? weight.lit : weight.dark;
  }
  return model;
}

LogisticModel Fit(const std::vector<LogisticSample>& samples, const LogisticModel& prior) {
  Eigen::VectorXd sigmas(prior.weights.size());
  for (size_t k = 0; k < agent::kWandFeatureCount; ++k) {
    const auto at = static_cast<Eigen::Index>(k);
    const double most = agent::WeightOf(static_cast<WandFeature>(k)).most;
    // The rendered wands are orange: they do not say what white is worth.
    if (static_cast<WandFeature>(k) == WandFeature::kWhite) {
      sigmas[at] = kFixed;
      continue;
    }
    sigmas[at] = std::max(kWeightSigma * prior.weights[at], kLeastCostSigma / most);
  }
  return FitLogistic(samples, prior, sigmas, kBiasSigma);
}

void PrintJudgement(const char* name, const std::vector<LogisticSample>& samples,
                    const LogisticModel& model) {
  constexpr double kAccepted = 0.405;  // log-odds of a confidence of 0.6
  int positives = 0, missed = 0, accepted = 0;
  for (const LogisticSample& sample : samples) {
    const bool is_accepted = model.LogOdds(sample.doubts) >= kAccepted;
    positives += sample.is_positive ? 1 : 0;
    missed += sample.is_positive && !is_accepted ? 1 : 0;
    accepted += !sample.is_positive && is_accepted ? 1 : 0;
  }
  fmt::print("  {:28} {:6} wands, {:4} refused; {:6} others, {:4} accepted\n", name, positives,
             missed, samples.size() - static_cast<size_t>(positives), accepted);
}

// "no large outline": kNoLargeOutline.
std::string EnumeratorOf(const std::string& name) {
  std::string enumerator = "k";
  for (size_t i = 0; i < name.size(); ++i) {
    if (name[i] == ' ') continue;
    const bool begins = i == 0 || name[i - 1] == ' ';
    enumerator += begins ? absl::ascii_toupper(static_cast<unsigned char>(name[i])) : name[i];
  }
  return enumerator;
}

std::string TableOf(const std::array<LogisticModel, 2>& models) {
  std::string text = fmt::format(
      "// SPDX-License-Identifier: Apache-2.0\n"
      "// Written by `rigcal-accuracy fit_wand_score`: do not edit.\n"
      "constexpr double kBiasDark = {:.4g}, kBiasLit = {:.4g};\n"
      "constexpr NamedWeight kWeights[] = {{\n",
      models[0].bias, models[1].bias);
  for (size_t k = 0; k < agent::kWandFeatureCount; ++k) {
    const auto feature = static_cast<WandFeature>(k);
    const agent::WandWeight& weight = agent::WeightOf(feature);
    const auto at = static_cast<Eigen::Index>(k);
    text += fmt::format("    {{WandFeature::{}, {{\"{}\", {:.4g}, {:.4g}, {:.4g}}}}},\n",
                        EnumeratorOf(weight.name), weight.name, weight.most, models[0].weights[at],
                        models[1].weights[at]);
  }
  return text + "};\n";
}

int RunFit(const FitArguments& arguments) {
  const auto training = Collect(arguments, arguments.first_seed, arguments.seeds);
  const auto judged =
      Collect(arguments, arguments.first_seed + arguments.seeds, arguments.judged_seeds);
  for (const auto* const samples : {&training, &judged}) {
    if (samples->ok()) continue;
    fmt::print(stderr, "{}\n", samples->status().ToString());
    return 1;
  }
  std::array<LogisticModel, 2> models;
  for (size_t light = 0; light < models.size(); ++light) {
    const LogisticModel today = TodaysModel(light == 1);
    // Wands alone say nothing about what is none.
    const bool has_others = std::ranges::any_of(
        (*training)[light], [](const LogisticSample& sample) { return !sample.is_positive; });
    models[light] = has_others ? Fit((*training)[light], today) : today;
    fmt::print("{}\n", light == 1 ? "lit rooms" : "dark rooms");
    PrintJudgement("training seeds, today", (*training)[light], today);
    PrintJudgement("training seeds, fitted", (*training)[light], models[light]);
    PrintJudgement("judged seeds, today", (*judged)[light], today);
    PrintJudgement("judged seeds, fitted", (*judged)[light], models[light]);
  }
  const std::string table = TableOf(models);
  fmt::print("\n{}", table);
  if (arguments.output.empty()) return 0;
  std::ofstream file(arguments.output);
  file << table;
  file.close();
  if (file) return 0;
  fmt::print(stderr, "cannot write {}\n", arguments.output);
  return 1;
}

Experiment::Run PrepareFit(OptionList* list) {
  const auto arguments = std::make_shared<FitArguments>();
  list->Add("--first-seed", &arguments->first_seed, 0, 4000000, "of rigs, waves, rooms and noise");
  list->Add("--seeds", &arguments->seeds, 1, 100, "that the weights are fitted to");
  list->Add("--judged", &arguments->judged_seeds, 1, 100, "seeds behind them that judge");
  list->Add("--duration", &arguments->duration_s, 1, 3600, "of each wave, s");
  list->Add("--threads", &arguments->threads, 1, 256, "cameras at the same time");
  list->Add("--output", &arguments->output, "file for the table of weights");
  return [arguments] { return RunFit(*arguments); };
}

}  // namespace

Experiment FitWandScore() {
  return {"fit_wand_score", "fits the weights by which candidates are taken for wands", PrepareFit};
}

}  // namespace rigcal::accuracy
