// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/signs_of_life.h"

#include <algorithm>

namespace rigcal::server {
namespace {

// Between two looks of a reader that runs.
constexpr std::chrono::milliseconds kLongestWait{2'000};

}  // namespace

SignsOfLife::SignsOfLife(SilenceLimits limits, Time now) : limits_(limits), last_look_(now) {}

void SignsOfLife::Hear(bool progress) {
  silence_ = std::chrono::milliseconds(0);
  if (progress) standstill_ = std::chrono::milliseconds(0);
}

SignsOfLife::State SignsOfLife::Look(Time now) {
  const auto whole = std::chrono::duration_cast<std::chrono::milliseconds>(now - last_look_);
  last_look_ += whole;
  const auto waited = std::min(whole, kLongestWait);
  silence_ += waited;
  standstill_ += waited;
  if (silence_ >= limits_.end) return State::kSilent;
  if (standstill_ >= limits_.stuck) return State::kStuck;
  return silence_ >= limits_.doubt ? State::kDoubtful : State::kAlive;
}

}  // namespace rigcal::server
