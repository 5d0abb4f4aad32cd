// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/prior_information.h"

#include <algorithm>
#include <cstddef>

namespace rigcal::server {
namespace {

double InverseSquare(double sigma) { return sigma > 0 ? 1 / (sigma * sigma) : 0; }

// Of the spans between the markers of wands.
void AddSpanPriors(const BundleTarget& target, const std::vector<ReducedParameter>& parameters,
                   Eigen::MatrixXd* prior) {
  const auto row_of = [&parameters](int marker) -> Eigen::Index {
    const ReducedParameter wanted = {ReducedParameterKind::kMarkerPosition, marker, 0};
    const auto found = std::find(parameters.begin(), parameters.end(), wanted);
    return found == parameters.end() ? -1 : found - parameters.begin();
  };
  for (const BundleWand& wand : target.Wands()) {
    Eigen::Index before = row_of(wand.first);
    if (before >= 0) (*prior)(before, before) += InverseSquare(kHeldMarkerSigmaM);
    for (int m = wand.first + 1; m < wand.end; ++m) {
      const Eigen::Index own = row_of(m);
      if (own < 0) return;
      const double weight = InverseSquare(wand.span_sigma_m);
      (*prior)(own, own) += weight;
      if (before >= 0) {
        (*prior)(before, before) += weight;
        (*prior)(own, before) = (*prior)(before, own) = -weight;
      }
      before = own;
    }
  }
}

}  // namespace

Eigen::MatrixXd PriorInformation(const BundleProblem& problem,
                                 const std::vector<ReducedParameter>& parameters) {
  const auto size = static_cast<Eigen::Index>(parameters.size());
  Eigen::MatrixXd prior = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    const ReducedParameter& parameter = parameters[static_cast<size_t>(i)];
    const auto index = static_cast<size_t>(parameter.index);
    switch (parameter.kind) {
      case ReducedParameterKind::kIntrinsic:
        prior(i, i) = InverseSquare(problem.cameras[index].intrinsics_sigma[parameter.component]);
        break;
      case ReducedParameterKind::kTimeOffset:
        prior(i, i) = InverseSquare(problem.clocks[index].offset_sigma_s);
        break;
      case ReducedParameterKind::kLineDelay:
        prior(i, i) = InverseSquare(problem.cameras[index].line_delay_sigma_s);
        break;
      case ReducedParameterKind::kTimeRate:
        prior(i, i) = InverseSquare(problem.clocks[index].rate_sigma);
        break;
      case ReducedParameterKind::kTargetPoint:
        prior(i, i) = InverseSquare(problem.rigid_target.sigma_m[index]);
        break;
      default:
        break;
    }
  }
  AddSpanPriors(problem.target, parameters, &prior);
  return prior;
}

}  // namespace rigcal::server
