// SPDX-License-Identifier: Apache-2.0
#include "server/live/overlap_counter.h"

#include <algorithm>
#include <functional>
#include <utility>

namespace rigcal::server {
namespace {

constexpr int64_t kMaxTimeNs = int64_t{1} << 62;

// Rounded down, also below zero.
int64_t StepOf(int64_t time_ns) {
  constexpr int64_t kStepNs = OverlapCounter::kStepNs;
  return time_ns >= 0 ? time_ns / kStepNs : -((-time_ns + kStepNs - 1) / kStepNs);
}

}  // namespace

OverlapCounter::OverlapCounter(size_t camera_count, size_t step_count)
    : camera_count_(std::min(camera_count, kMaxCameras)),
      steps_(step_count),
      pairs_(camera_count_ * (camera_count_ - std::min<size_t>(camera_count_, 1)) / 2),
      shared_(camera_count_) {}

size_t OverlapCounter::PairIndex(size_t a, size_t b) const {
  if (a > b) std::swap(a, b);
  return a * (2 * camera_count_ - a - 1) / 2 + (b - a - 1);
}

void OverlapCounter::Add(size_t camera, int64_t begin_ns, int64_t end_ns) {
  if (camera >= camera_count_ || begin_ns < -kMaxTimeNs || end_ns > kMaxTimeNs) return;
  // The steps whose middle lies within.
  const int64_t first = StepOf(begin_ns + kStepNs / 2 - 1);
  const int64_t last = std::min(StepOf(end_ns + kStepNs / 2 - 1), first + 64);
  const auto step_count = static_cast<int64_t>(steps_.size());
  for (int64_t number = first; number < last; ++number) {
    const int64_t place = number % step_count;
    Step& step = steps_[static_cast<size_t>(place < 0 ? place + step_count : place)];
    if (step.number != number) {
      // A later one has taken its place: too old to be counted.
      if (step.cameras.any() && step.number > number) continue;
      step.number = number;
      step.cameras.reset();
    }
    if (step.cameras.test(camera)) continue;
    const size_t others = step.cameras.count();
    if (others > 0) ++shared_[camera];
    for (size_t other = 0; others > 0 && other < camera_count_; ++other) {
      if (!step.cameras.test(other)) continue;
      ++pairs_[PairIndex(camera, other)];
      if (others == 1) ++shared_[other];
    }
    step.cameras.set(camera);
  }
}

void OverlapCounter::Add(const OverlapCounter& other) {
  if (other.camera_count_ != camera_count_) return;
  std::ranges::transform(pairs_, other.pairs_, pairs_.begin(), std::plus<>());
  std::ranges::transform(shared_, other.shared_, shared_.begin(), std::plus<>());
}

double OverlapCounter::PairS(size_t a, size_t b) const {
  return 1e-9 * static_cast<double>(kStepNs) * pairs_[PairIndex(a, b)];
}

double OverlapCounter::SharedS(size_t camera) const {
  return 1e-9 * static_cast<double>(kStepNs) * shared_[camera];
}

}  // namespace rigcal::server
