// SPDX-License-Identifier: Apache-2.0
#include "agent/command/detection_explanation.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "agent/detect/frame/other_spacing.h"
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

nlohmann::ordered_json PlacesJson(const VerifiedWand& wand) {
  auto places = nlohmann::ordered_json::array();
  for (const MarkerCentre& centre : wand.centres) {
    places.push_back({centre.centre_px.x(), centre.centre_px.y()});
  }
  return places;
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

// Sets of blobs that were not scored, by the reason.
std::map<std::string, std::vector<const WandTrial*>> Refusals(const WandExplanation& explanation) {
  std::map<std::string, std::vector<const WandTrial*>> refusals;
  for (const WandTrial& trial : explanation.trials) {
    if (!trial.refusal.empty()) refusals[std::string(trial.refusal)].push_back(&trial);
  }
  return refusals;
}

std::string FormatRefusals(const WandExplanation& explanation) {
  std::string text;
  for (const auto& [reason, trials] : Refusals(explanation)) {
    absl::StrAppend(&text, "  ", trials.size(),
                    trials.size() == 1 ? " set of blobs" : " sets of blobs",
                    " refused before: ", reason, "\n");
    // Several colours give the same blobs.
    std::set<std::string> places;
    for (const WandTrial* trial : trials) places.insert(Places(trial->wand));
    size_t shown = 0;
    for (const std::string& place : places) {
      if (++shown <= kShown) absl::StrAppend(&text, "    at ", place, " px\n");
    }
  }
  return text;
}

// Why no candidate became a wand, beyond what is said of each; empty: nothing more is known.
std::string WhyNone(const WandExplanation& explanation, const Target& target) {
  const Detection& detection = explanation.detection;
  if (detection.outcome == DetectionOutcome::kWand) return "";
  const std::string other = OtherWandText(detection, target);
  if (!other.empty()) return other;
  if (detection.blob_count == 0) {
    return absl::StrFormat(
        "%.2g %% of the picture has the wand's colour, none of it as large as a sphere: if the "
        "wand "
        "is there, `rigcal-agent tune` on some pictures finds its colour",
        100 * detection.passed_share);
  }
  const int needed = static_cast<int>(target.marker_positions_m.size());
  if (detection.blob_count < needed) {
    return absl::StrFormat("a wand of this target has %d spheres: %s not seen", needed,
                           needed - detection.blob_count == 1
                               ? "one is"
                               : absl::StrCat(needed - detection.blob_count, " are"));
  }
  if (explanation.trials.empty()) {
    return absl::StrFormat(
        "no %d of the blobs are on a line, alike in size and spaced as the target says; a bent "
        "wand "
        "is not on a line",
        needed);
  }
  return "";
}

}  // namespace

std::string FormatExplanation(const std::string& name, const WandExplanation& explanation,
                              const Target& target, double min_confidence) {
  const Detection& detection = explanation.detection;
  std::string text = absl::StrCat(name, ": ", std::string(DetectionOutcomeText(detection.outcome)));
  if (detection.outcome == DetectionOutcome::kWand) {
    absl::StrAppendFormat(&text, ", confidence %.3f", detection.confidence);
  }
  absl::StrAppend(&text, "; ", detection.blob_count, " blobs",
                  detection.cut_short ? ", candidates left out: too many" : "", "\n");
  size_t scored = 0;
  for (const WandTrial& trial : explanation.trials) {
    if (!trial.refusal.empty()) continue;
    if (++scored <= kShown) text += FormatCandidate(scored, trial, min_confidence);
  }
  if (scored > kShown) absl::StrAppend(&text, "\n  ", scored - kShown, " less likely ones\n");
  if (scored == 0 && detection.blob_count > 2) text += "  no three blobs were scored\n";
  text += FormatRefusals(explanation);
  const std::string why = WhyNone(explanation, target);
  if (!why.empty()) absl::StrAppend(&text, "  ", why, "\n");
  if (detection.outcome == DetectionOutcome::kAmbiguous) {
    text += "  two candidates are about as likely, so neither is taken\n";
  }
  return text;
}

std::string ExplanationJson(const std::string& name, const WandExplanation& explanation,
                            const Target& target) {
  using Json = nlohmann::ordered_json;
  const Detection& detection = explanation.detection;
  Json json = {{"picture", name},
               {"outcome", std::string(DetectionOutcomeText(detection.outcome))},
               {"confidence", detection.confidence},
               {"blobs", detection.blob_count},
               {"cut_short", detection.cut_short},
               {"candidates", Json::array()},
               {"refused", Json::array()},
               {"why", WhyNone(explanation, target)}};
  for (const WandTrial& trial : explanation.trials) {
    if (!trial.refusal.empty()) continue;
    Json candidate = {{"markers_px", PlacesJson(trial.wand)},
                      {"log_odds", trial.wand.log_odds},
                      {"confidence", trial.wand.confidence},
                      {"lit", trial.is_lit},
                      {"features", Json::object()}};
    for (size_t k = 0; k < kWandFeatureCount; ++k) {
      const auto feature = static_cast<WandFeature>(k);
      candidate["features"][WeightOf(feature).name] = {
          {"value", trial.wand.features[feature]},
          {"cost", WandCost(trial.wand.features, feature, trial.is_lit)}};
    }
    json["candidates"].push_back(std::move(candidate));
  }
  for (const auto& [reason, trials] : Refusals(explanation)) {
    Json places = Json::array();
    for (size_t i = 0; i < std::min(trials.size(), kShown); ++i) {
      places.push_back(PlacesJson(trials[i]->wand));
    }
    json["refused"].push_back(
        {{"reason", reason}, {"count", trials.size()}, {"markers_px", std::move(places)}});
  }
  return json.dump() + "\n";
}

}  // namespace rigcal::agent
