// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdlib>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "server/solve/diagnose/finding_causes.h"
#include "server/solve/diagnose/session_timeline.h"
#include "server/solve/diagnose/wand_shape.h"

namespace rigcal::server {
namespace {

// Share of the mean error of all cameras that a fault of the wand must explain.
constexpr double kMinWandGain = 0.08;
constexpr double kMinFaultSigmas = 5;
constexpr double kMinFaultM = 5e-4;
constexpr int kStraightenRounds = 2;

struct WandExplanation {
  WandFault fault;
  TrialProblem repaired;
  double before_px = 0, after_px = 0;

  double Gain() const { return 1 - after_px / before_px; }
};

const char* PlaceName(int place) {
  return place == 0 ? "its first marker" : place == 1 ? "its middle marker" : "its last marker";
}

double MeanPx(const std::vector<WandSample>& samples) {
  double sum_px = 0;
  for (const WandSample& sample : samples) sum_px += sample.residual.norm();
  return samples.empty() ? 0 : sum_px / static_cast<double>(samples.size());
}

std::string Name(const WandExplanation& own) {
  switch (own.fault.form) {
    case WandFault::Form::kBends:
      return "if it is bent";
    case WandFault::Form::kSags:
      return "if it sags";
    case WandFault::Form::kSlips:
      return "if a marker slips";
  }
  return "";
}

std::string Advice(const WandExplanation& own, const SessionTimeline& timeline,
                   const std::string& next) {
  const WandFault& fault = own.fault;
  const std::string errors =
      absl::StrFormat("the mean error is %.2f px, and %.2f px with that taken out%s", own.before_px,
                      own.after_px, next);
  const double size_mm = 1e3 * std::abs(fault.size_m), sigma_mm = 1e3 * fault.sigma_m;
  switch (fault.form) {
    case WandFault::Form::kBends:
      return absl::StrFormat(
          "the wand is bent: its middle marker is %.1f mm (+-%.2f mm) off the line through the two "
          "others; %s. Straighten it, or take a stiffer bar, and record again",
          size_mm, sigma_mm, errors);
    case WandFault::Form::kSags:
      return absl::StrFormat(
          "the wand sags: lying, its middle marker is %.1f mm (+-%.2f mm) off the line through the "
          "two others, always towards the same side of the room; %s. Take a stiffer bar, and "
          "record again",
          size_mm, sigma_mm, errors);
    case WandFault::Form::kSlips:
      return absl::StrFormat(
          "%s slipped along the wand by %.1f mm (+-%.2f mm) %s; %s. Fasten it, measure the spans "
          "again and record again, or calibrate what was recorded before it slipped",
          PlaceName(fault.place), size_mm, sigma_mm, timeline.Describe(fault.time_ns), errors);
  }
  return "";
}

std::optional<WandFault> FaultOf(WandFault::Form form, const TrialProblem& trial,
                                 const SessionTimeline& timeline,
                                 const std::vector<WandSample>& samples) {
  const std::vector<WandShape> shapes = WandShapesOf(trial, timeline, samples);
  switch (form) {
    case WandFault::Form::kBends:
      return BendOf(trial, samples, shapes);
    case WandFault::Form::kSags:
      return SagOf(shapes);
    case WandFault::Form::kSlips:
      return SlipOf(shapes);
  }
  return std::nullopt;
}

std::optional<WandExplanation> Try(const CauseInput& input, const SessionTimeline& timeline,
                                   WandFault::Form form) {
  WandExplanation own;
  own.repaired = input.trial;
  std::vector<WandSample> samples = WandSamplesOf(own.repaired);
  own.before_px = MeanPx(samples);
  const double bend_gain_px = BendGainPx(own.repaired, samples);
  // Without what the other cameras confirm a bend explains nothing.
  if (form == WandFault::Form::kBends && bend_gain_px < kMinWandGain * own.before_px) {
    return std::nullopt;
  }
  for (int round = 0; round < kStraightenRounds; ++round) {
    std::optional<WandFault> fault = FaultOf(form, own.repaired, timeline, samples);
    if (!fault) return std::nullopt;
    if (round == 0) {
      if (!(std::abs(fault->size_m) > std::max(kMinFaultM, kMinFaultSigmas * fault->sigma_m))) {
        return std::nullopt;
      }
      own.fault = *fault;
    } else if (form == WandFault::Form::kSlips) {
      own.fault.size_m += fault->place == own.fault.place ? fault->size_m : 0;
      fault->time_ns = own.fault.time_ns;
    } else if (form == WandFault::Form::kSags) {
      own.fault.sag_m += fault->sag_m;
      own.fault.size_m = own.fault.sag_m.norm();
    }
    Straighten(*fault, samples, timeline, &own.repaired);
    if (!SolveTrialFromAfar(input.trial.bundle, &own.repaired.problem).ok()) return std::nullopt;
    samples = WandSamplesOf(own.repaired);
    // A bend has a direction at each instant, which takes noise out with it: one round, and what
    // the other cameras confirm is what counts.
    if (form == WandFault::Form::kBends) break;
  }
  own.after_px = form == WandFault::Form::kBends ? own.before_px - bend_gain_px : MeanPx(samples);
  if (own.Gain() < kMinWandGain) return std::nullopt;
  return own;
}

}  // namespace

Repair RepairWand(const CauseInput& input) {
  Repair repair;
  if (WandSamplesOf(input.trial).empty()) return repair;
  const SessionTimeline timeline(input.trial, input.evaluated.solution.clocks);
  std::optional<WandExplanation> best, next;
  for (const WandFault::Form form :
       {WandFault::Form::kSlips, WandFault::Form::kSags, WandFault::Form::kBends}) {
    std::optional<WandExplanation> own = Try(input, timeline, form);
    if (!own) continue;
    if (!best || own->after_px < best->after_px) std::swap(own, best);
    if (own && (!next || own->after_px < next->after_px)) next = std::move(own);
  }
  if (!best) return repair;
  const std::string beside =
      next ? absl::StrFormat(" (%.2f px %s)", next->after_px, Name(*next)) : "";
  repair.causes.push_back({{FindingKind::kWandNotRigid, "", 1e3 * std::abs(best->fault.size_m),
                            "mm", Advice(*best, timeline, beside)},
                           best->before_px - best->after_px});
  repair.gain_px = best->before_px - best->after_px;
  repair.repaired = std::move(best->repaired);
  return repair;
}

}  // namespace rigcal::server
