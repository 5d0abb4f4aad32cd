// SPDX-License-Identifier: Apache-2.0
#include "agent/command/detection_explanation.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/target/detection_outcome.h"

namespace rigcal::agent {
namespace {

constexpr size_t kShown = 3;  // candidates that are shown in full

std::string Places(const VerifiedWand& wand) {
  std::string text;
  for (const MarkerCentre& centre : wand.centres) {
    absl::StrAppendFormat(&text, "%s(%.1f, %.1f)", text.empty() ? "" : " ", centre.centre_px.x(),
                          centre.centre_px.y());
  }
  return text;
}

// "54 : 1", "1 : 8".
std::string Odds(double log_odds) {
  const double ratio = std::exp(std::abs(log_odds));
  const std::string text = ratio < 9.95  ? absl::StrFormat("%.1f", ratio)
                           : ratio < 1e6 ? absl::StrFormat("%.0f", ratio)
                                         : ">1000000";
  return log_odds >= 0 ? absl::StrCat(text, " : 1") : absl::StrCat("1 : ", text);
}

// Those that cost something, the dearest first.
std::vector<WandFeature> Dearest(const WandTrial& trial) {
  std::vector<WandFeature> features;
  for (size_t k = 0; k < kWandFeatureCount; ++k) features.push_back(static_cast<WandFeature>(k));
  const auto cost = [&](WandFeature feature) {
    return WandCost(trial.wand.features, feature, trial.is_lit);
  };
  std::ranges::stable_sort(features,
                           [&](WandFeature a, WandFeature b) { return cost(a) > cost(b); });
  std::erase_if(features, [&](WandFeature feature) { return !(cost(feature) > 0); });
  return features;
}

std::string FormatCandidate(size_t number, const WandTrial& trial, double min_confidence) {
  const VerifiedWand& wand = trial.wand;
  const std::vector<WandFeature> features = Dearest(trial);
  std::string text = absl::StrFormat("\n  candidate %d at %s px: ", number, Places(wand));
  if (wand.confidence >= min_confidence) {
    absl::StrAppend(&text, "odds ", Odds(wand.log_odds), ", a wand\n");
  } else {
    absl::StrAppend(
        &text, "odds ", Odds(wand.log_odds), ", less than the confidence of ",
        absl::StrFormat("%.2f", min_confidence), " that is asked for",
        features.empty() ? "" : absl::StrCat("; mostly for ", WeightOf(features[0]).name), "\n");
  }
  absl::StrAppendFormat(&text, "    %-18s %10s %10.2f\n",
                        trial.is_lit ? "a lit room" : "a dark room", "", MostLogOdds(trial.is_lit));
  for (const WandFeature feature : features) {
    absl::StrAppendFormat(&text, "    %-18s %10.4g %10.2f\n", WeightOf(feature).name,
                          wand.features[feature], -WandCost(wand.features, feature, trial.is_lit));
  }
  absl::StrAppendFormat(&text, "    %-18s %10s %10.2f\n", "log-odds", "", wand.log_odds);
  return text;
}

std::map<std::string, int> Refusals(const WandExplanation& explanation) {
  std::map<std::string, int> counts;
  for (const WandTrial& trial : explanation.trials) {
    if (!trial.refusal.empty()) ++counts[std::string(trial.refusal)];
  }
  return counts;
}

}  // namespace

std::string FormatExplanation(const std::string& name, const WandExplanation& explanation,
                              double min_confidence) {
  const Detection& detection = explanation.detection;
  std::string text = absl::StrCat(name, ": ", std::string(DetectionOutcomeText(detection.outcome)));
  if (detection.outcome == DetectionOutcome::kWand) {
    absl::StrAppendFormat(&text, ", confidence %.3f", detection.confidence);
  }
  absl::StrAppend(&text, "; ", detection.blob_count, " blobs",
                  detection.cut_short ? ", candidates left out for the time" : "", "\n");
  size_t scored = 0;
  for (const WandTrial& trial : explanation.trials) {
    if (!trial.refusal.empty()) continue;
    if (++scored <= kShown) text += FormatCandidate(scored, trial, min_confidence);
  }
  if (scored > kShown) absl::StrAppend(&text, "\n  ", scored - kShown, " less likely ones\n");
  if (scored == 0) text += "  no three blobs were scored\n";
  for (const auto& [reason, count] : Refusals(explanation)) {
    absl::StrAppend(&text, "  ", count, count == 1 ? " set of blobs" : " sets of blobs",
                    " refused before: ", reason, "\n");
  }
  if (detection.outcome == DetectionOutcome::kAmbiguous) {
    text += "  two candidates are about as likely, so neither is taken\n";
  }
  return text;
}

std::string ExplanationJson(const std::string& name, const WandExplanation& explanation) {
  using Json = nlohmann::ordered_json;
  const Detection& detection = explanation.detection;
  Json json = {{"picture", name},
               {"outcome", std::string(DetectionOutcomeText(detection.outcome))},
               {"confidence", detection.confidence},
               {"blobs", detection.blob_count},
               {"cut_short", detection.cut_short},
               {"candidates", Json::array()},
               {"refused", Json::array()}};
  for (const WandTrial& trial : explanation.trials) {
    if (!trial.refusal.empty()) continue;
    Json candidate = {{"markers_px", Json::array()},
                      {"log_odds", trial.wand.log_odds},
                      {"confidence", trial.wand.confidence},
                      {"lit", trial.is_lit},
                      {"features", Json::object()}};
    for (const MarkerCentre& centre : trial.wand.centres) {
      candidate["markers_px"].push_back({centre.centre_px.x(), centre.centre_px.y()});
    }
    for (size_t k = 0; k < kWandFeatureCount; ++k) {
      const auto feature = static_cast<WandFeature>(k);
      candidate["features"][WeightOf(feature).name] = {
          {"value", trial.wand.features[feature]},
          {"cost", WandCost(trial.wand.features, feature, trial.is_lit)}};
    }
    json["candidates"].push_back(std::move(candidate));
  }
  for (const auto& [reason, count] : Refusals(explanation)) {
    json["refused"].push_back({{"reason", reason}, {"count", count}});
  }
  return json.dump() + "\n";
}

}  // namespace rigcal::agent
