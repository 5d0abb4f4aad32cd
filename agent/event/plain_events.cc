// SPDX-License-Identifier: Apache-2.0
#include "agent/event/plain_events.h"

namespace rigcal::agent {

PlainClock::Verdict PlainClock::Decide(int64_t time_us, const int64_t* next) {
  const int64_t last_us = time_us_;
  if (known_ && next != nullptr && Follows(*next, last_us) && !Follows(*next, time_us)) {
    return Verdict::kDamaged;
  }
  const bool first = !known_;
  known_ = true;
  time_us_ = time_us;
  if (first) return Verdict::kGoesOn;
  if (time_us < last_us) return Verdict::kStepBack;
  const uint64_t ahead = static_cast<uint64_t>(time_us) - static_cast<uint64_t>(last_us);
  return ahead > static_cast<uint64_t>(kLeapUs) ? Verdict::kLeap : Verdict::kGoesOn;
}

}  // namespace rigcal::agent
