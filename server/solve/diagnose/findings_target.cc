// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "server/solve/diagnose/finding_causes.h"

namespace rigcal::server {
namespace {

// The prior pulls both spans: of 10 mm in the last marker of 0, 0.13, 0.39 m, 2.2 tolerances show
// in the ratio.
constexpr double kTargetSigmas = 2;

std::vector<double> Spans(const std::vector<double>& positions_m) {
  std::vector<double> spans;
  for (size_t m = 1; m < positions_m.size(); ++m) {
    spans.push_back(positions_m[m] - positions_m[m - 1]);
  }
  return spans;
}

// What a span is if all the others are as given: images give the ratios of the spans only.
double LengthByTheOthers(const std::vector<double>& given_m, const std::vector<double>& found_m,
                         size_t span) {
  double product = 0, square = 0;
  for (size_t s = 0; s < given_m.size(); ++s) {
    if (s == span) continue;
    product += given_m[s] * found_m[s];
    square += found_m[s] * found_m[s];
  }
  return found_m[span] * product / square;
}

// A span of one of the wands.
struct WandSpan {
  size_t wand = 0, span = 0;
  double given_m = 0, found_m = 0, sigma_m = 0;

  double ErrorM() const { return found_m - given_m; }
};

std::vector<WandSpan> SpansOfWands(const BundleTarget& target) {
  std::vector<WandSpan> spans;
  const std::vector<BundleWand> wands = target.Wands();
  for (size_t w = 0; w < wands.size(); ++w) {
    for (auto m = static_cast<size_t>(wands[w].first) + 1; m < static_cast<size_t>(wands[w].end);
         ++m) {
      spans.push_back({w, m - static_cast<size_t>(wands[w].first),
                       target.given_positions_m[m] - target.given_positions_m[m - 1],
                       target.marker_positions_m[m] - target.marker_positions_m[m - 1],
                       wands[w].span_sigma_m});
    }
  }
  return spans;
}

// Beside another target with a scale of its own, every span is measured by itself; that they do not
// go together is all that the images say.
std::vector<Cause> WandAgainstOthers(const BundleProblem& problem) {
  const std::vector<WandSpan> spans = SpansOfWands(problem.target);
  double chi2 = 0;
  for (const WandSpan& span : spans) chi2 += std::pow(span.ErrorM() / span.sigma_m, 2);
  if (spans.empty() || !(std::sqrt(chi2) > kTargetSigmas)) return {};
  const WandSpan& worst = *std::ranges::max_element(
      spans, {}, [](const WandSpan& span) { return std::abs(span.ErrorM()); });
  const std::string wand =
      problem.HasSeveralWands() ? absl::StrCat("wand ", worst.wand + 1) : "the wand";
  const std::string others = problem.HasBody() ? "the rigid target" : "the other wand";
  return {{{FindingKind::kWrongWandLength, "", 1e3 * worst.ErrorM(), "mm",
            absl::StrFormat(
                "%s and %s contradict each other: beside it span %d of the wand is %.1f mm long, "
                "not %.1f mm (tolerance %.1f mm). The images do not say which of them is wrong. "
                "Measure the spans of every wand from centre to centre and the points of a rigid "
                "target again, give them again and calibrate again",
                wand, others, static_cast<int>(worst.span), 1e3 * worst.found_m,
                1e3 * worst.given_m, 1e3 * worst.sigma_m)},
           0}};
}

}  // namespace

std::vector<Cause> FindWrongWandLength(const CauseInput& input) {
  const TrialProblem& trial = input.trial;
  BundleProblem problem = trial.problem;
  const std::vector<double> given_m = Spans(problem.target.given_positions_m);
  // One span is the scale itself: nothing else tells it from what it should be.
  const bool has_others = problem.HasBody() || problem.HasSeveralWands();
  if (given_m.empty() || (given_m.size() < 2 && !has_others)) return {};
  ErrorChange change;
  if (problem.target.fixed) {
    problem.target.fixed = false;
    if (!SolveTrial(trial.bundle, &problem).ok()) return {};
    change = Overall(CompareErrors(trial.problem, problem));
  } else {
    BundleProblem as_given = problem;
    as_given.target.fixed = true;
    as_given.target.marker_positions_m = as_given.target.given_positions_m;
    if (SolveTrial(trial.bundle, &as_given).ok())
      change = Overall(CompareErrors(as_given, problem));
  }
  const std::vector<double> found_m = Spans(problem.target.marker_positions_m);
  if (has_others) return WandAgainstOthers(problem);
  const double tolerance_m = problem.target.span_sigma_m;
  double chi2 = 0;
  size_t worst = 0;
  double worst_error_m = 0, worst_sigmas = 0;
  for (size_t s = 0; s < given_m.size(); ++s) {
    chi2 += std::pow((found_m[s] - given_m[s]) / tolerance_m, 2);
    // Of the one span that would have to be wrong, the one that says so most clearly; between two
    // it is the shorter one, which needs the smaller error.
    const double error_m = LengthByTheOthers(given_m, found_m, s) - given_m[s];
    const double sigmas =
        std::abs(error_m) / (tolerance_m * std::hypot(1.0, found_m[s] / given_m[s]));
    if (given_m.size() == 2 ? (s == 0 || std::abs(error_m) < std::abs(worst_error_m))
                            : sigmas > worst_sigmas) {
      worst = s;
      worst_error_m = error_m;
      worst_sigmas = sigmas;
    }
  }
  if (!(std::sqrt(chi2) > kTargetSigmas)) return {};
  std::string advice = absl::StrFormat(
      "the images say that span %d of the wand is %.1f mm long if the others are as given, not "
      "%.1f mm (tolerance %.1f mm)",
      static_cast<int>(worst) + 1, 1e3 * (given_m[worst] + worst_error_m), 1e3 * given_m[worst],
      1e3 * tolerance_m);
  if (given_m.size() == 2) {
    const size_t other = 1 - worst;
    absl::StrAppendFormat(&advice, ", or that span %d is %.1f mm long, not %.1f mm",
                          static_cast<int>(other) + 1,
                          1e3 * LengthByTheOthers(given_m, found_m, other), 1e3 * given_m[other]);
  }
  if (change.before_px > 0) {
    absl::StrAppendFormat(&advice,
                          "; the error is %.2f px with the given spans, %.2f px with these",
                          change.before_px, change.after_px);
  }
  // The scale by the span that would be wrong, and by the others: the solution lies between.
  absl::StrAppendFormat(
      &advice,
      ". The images give the ratios of the spans only, not which of them is wrong: the scale may "
      "be "
      "off by %.1f %%. Measure all spans from centre to centre, give them again and calibrate "
      "again; every length of the rig is as wrong as the wand's",
      100 * std::abs(worst_error_m) / given_m[worst]);
  return {{{FindingKind::kWrongWandLength, "", 1e3 * worst_error_m, "mm", advice},
           std::max(0.0, change.gain_px())}};
}

}  // namespace rigcal::server
