// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/search_budget.h"

#include <algorithm>

namespace rigcal::agent {
namespace {

constexpr double kMsOfWork = 110e-6, kMsOfFit = 2500e-6;
constexpr double kMostMs = 5.1;

}  // namespace

double SearchBudget::TakeWork(double most, double least) {
  const double work = std::max(least, std::min(work_left_, most));
  work_left_ -= work;
  return work;
}

double SearchBudget::MsWithoutWork(double spots_ms) const { return spots_ms + kMsOfFit * fits(); }

double SearchBudget::EstimatedMs(double spots_ms) const {
  return MsWithoutWork(spots_ms) + kMsOfWork * (kMostWork - work_cut_ - work_left_);
}

void SearchBudget::CutWork(double spots_ms) {
  const double most = (kMostMs - MsWithoutWork(spots_ms)) / kMsOfWork;
  const double cut = std::max(0.0, std::min(kMostWork - most - work_cut_, work_left_));
  work_cut_ += cut;
  work_left_ -= cut;
}

}  // namespace rigcal::agent
