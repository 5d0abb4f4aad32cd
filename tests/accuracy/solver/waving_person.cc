// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/waving_person.h"

#include <algorithm>
#include <utility>

namespace rigcal::accuracy {
namespace {

constexpr uint64_t kPersonPurpose = 0x706572736f6e;
constexpr double kStayS = 4;
constexpr double kReachM = 0.25;  // around a place, one sigma
constexpr double kTurn = 0.6;     // around its direction, one sigma of a unit vector
constexpr double kSpeedMS = 1.0;
constexpr double kShortestStrokeS = 0.25;

}  // namespace

WavingPerson::WavingPerson(const WaveVolume& volume, uint32_t seed)
    : volume_(volume), random_{seed, kPersonPurpose, 2} {
  to_ = {volume.centre_m, Eigen::Vector3d::UnitX()};
}

void WavingPerson::GoTo(std::vector<WandPose> places) {
  places_ = std::move(places);
  if (!places_.empty() && (places_.front().origin_m - place_.origin_m).norm() > 2 * kReachM) {
    leave_s_ = end_s_;
  }
}

WandPose WavingPerson::At(double time_s) {
  while (time_s >= end_s_) NextStroke();
  const double share = std::clamp((time_s - begin_s_) / (end_s_ - begin_s_), 0.0, 1.0);
  const double smooth = share * share * (3 - 2 * share);
  return {from_.origin_m + smooth * (to_.origin_m - from_.origin_m),
          (from_.direction + smooth * (to_.direction - from_.direction)).normalized()};
}

Eigen::Vector3d WavingPerson::Gaussian() {
  Eigen::Vector3d values;
  for (double& value : values) value = random_.Gaussian();
  return values;
}

Eigen::Vector3d WavingPerson::Within(const Eigen::Vector3d& point_m) const {
  return point_m.cwiseMin(volume_.centre_m + volume_.half_extent_m)
      .cwiseMax(volume_.centre_m - volume_.half_extent_m);
}

void WavingPerson::ChoosePlace() {
  if (!places_.empty()) {
    place_ = places_.front();
    // Not the same again until told anew.
    if (places_.size() > 1) places_.erase(places_.begin());
    return;
  }
  place_.origin_m = Within(volume_.centre_m + 0.5 * volume_.half_extent_m.cwiseProduct(Gaussian()));
  place_.direction = Gaussian().normalized();
}

void WavingPerson::NextStroke() {
  if (end_s_ >= leave_s_) {
    ChoosePlace();
    leave_s_ = end_s_ + kStayS;
  }
  from_ = to_;
  begin_s_ = end_s_;
  to_.origin_m = Within(place_.origin_m + kReachM * Gaussian());
  to_.direction = (place_.direction + kTurn * Gaussian()).normalized();
  if (to_.direction.dot(from_.direction) < 0) to_.direction = -to_.direction;
  end_s_ = begin_s_ +
           std::max(kShortestStrokeS, 1.5 * (to_.origin_m - from_.origin_m).norm() / kSpeedMS);
}

}  // namespace rigcal::accuracy
