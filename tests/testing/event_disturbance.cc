// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/event_disturbance.h"

#include <algorithm>

#include "common/simulation/world/random_stream.h"

namespace rigcal::testing {
namespace {

constexpr int64_t kControlPeriodUs = 200;
constexpr uint64_t kOfMilliseconds = 1, kOfEvents = 2, kOfPeriods = 3;

}  // namespace

void EventDisturber::LimitRate(std::vector<SimulatedEvent>* events) const {
  const double most = disturbance_.rate_limit * kControlPeriodUs * 1e-6;
  std::vector<SimulatedEvent> kept;
  for (size_t begin = 0; begin < events->size();) {
    const int64_t period = (*events)[begin].time_us / kControlPeriodUs;
    size_t end = begin;
    while (end < events->size() && (*events)[end].time_us / kControlPeriodUs == period) ++end;
    const auto count = static_cast<double>(end - begin);
    RandomStream random{disturbance_.seed, kOfPeriods, static_cast<uint64_t>(period)};
    for (size_t i = begin; i < end; ++i) {
      const bool fits = disturbance_.keeps_first ? static_cast<double>(i - begin) < most
                                                 : random.Uniform() * count < most;
      if (fits) kept.push_back((*events)[i]);
    }
    begin = end;
  }
  events->swap(kept);
}

void EventDisturber::Apply(std::vector<SimulatedEvent>* events) {
  if (disturbance_.is_none()) return;
  if (disturbance_.rate_limit > 0) LimitRate(events);
  const auto is_lost = [this](const SimulatedEvent& event) {
    const uint64_t number = count_++;
    if (disturbance_.keep_every > 1 &&
        number % static_cast<uint64_t>(disturbance_.keep_every) != 0) {
      return true;
    }
    if (disturbance_.kept_share < 1 &&
        RandomStream{disturbance_.seed, kOfEvents, number}.Uniform() >= disturbance_.kept_share) {
      return true;
    }
    const auto millisecond = static_cast<uint64_t>(event.time_us / 1000);
    return disturbance_.lost_ms_share > 0 &&
           RandomStream{disturbance_.seed, kOfMilliseconds, millisecond}.Uniform() <
               disturbance_.lost_ms_share;
  };
  events->erase(std::remove_if(events->begin(), events->end(), is_lost), events->end());
}

}  // namespace rigcal::testing
