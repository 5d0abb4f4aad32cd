// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event_board/burst_finder.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "common/statistics/robust_statistics.h"

namespace rigcal::agent {
namespace {

constexpr double kLeastNet = 150;     // events: of 40 circles of some pixels
constexpr double kOverNoise = 6;      // over the root of the number of events
constexpr double kLeastShare = 0.35;  // of the recent bursts
constexpr double kFootShare = 0.1;    // of its height, where a burst begins and ends
constexpr double kLevelMs = 2000;     // time constant in which recent bursts are forgotten
constexpr int kFootMs = 3;            // what is left out below the foot
constexpr double kLeastApartMs = 12;
constexpr size_t kPeriods = 40;
constexpr double kLowestFlickerHz = 45, kHighestFlickerHz = 1900;
constexpr double kFlickerOverNoise = 40;  // in power, over the median

}  // namespace

std::optional<Burst> BurstFinder::Take(int64_t time_ms, size_t events, int net) {
  sum_ += net;
  events_ += static_cast<double>(events);
  if (sums_.size() >= kBoxMs) {
    sum_ -= sums_[sums_.size() - kBoxMs].net;
    events_ -= sums_[sums_.size() - kBoxMs].events;
  }
  sums_.push_back({time_ms, static_cast<double>(events), net, sum_});
  if (sums_.size() > 2 * kMostMs) sums_.pop_front();
  level_ *= std::exp(-1 / kLevelMs);
  if (sign_ == 0) {
    if (!is_armed_) is_armed_ = std::abs(sum_) < kFootShare * level_;
    if (!is_armed_ || std::abs(sum_) < std::max({kLeastNet, kLeastShare * level_,
                                                 kOverNoise * std::sqrt(events_)})) {
      return std::nullopt;
    }
    sign_ = sum_ > 0 ? 1 : -1;
    peak_ = 0;
  }
  const double height = sign_ * sum_;
  if (height > peak_) {
    peak_ = height;
    peak_ms_ = time_ms;
  }
  if (height < kFootShare * peak_) return End(time_ms);
  if (time_ms - peak_ms_ > kMostMs) {  // light that changes for good
    level_ = std::max(level_, peak_);
    sign_ = 0;
    is_armed_ = false;
  }
  return std::nullopt;
}

std::optional<Burst> BurstFinder::End(int64_t time_ms) {
  Burst burst{.on = sign_ > 0};
  level_ = std::max(level_, peak_);
  const int sign = sign_;
  sign_ = 0;
  size_t first = sums_.size() - 1;
  while (first > 0 && sums_[first].time_ms > peak_ms_) --first;
  while (first > 0 && sign * sums_[first - 1].sum >= kFootShare * peak_) --first;
  burst.first_ms = sums_[first].time_ms - kFootMs;
  burst.last_ms = time_ms - kBoxMs + kFootMs;
  double weight = 0, moment = 0;
  for (const Sum& sum : sums_) {
    if (sum.time_ms < burst.first_ms || sum.time_ms > burst.last_ms) continue;
    weight += sum.net;
    moment += sum.net * static_cast<double>(sum.time_ms - burst.first_ms);
  }
  if (!(sign * weight > 0) || burst.last_ms - burst.first_ms > kMostMs) return std::nullopt;
  burst.time_ms = static_cast<double>(burst.first_ms) + moment / weight;
  const bool is_quick = last_burst_ms_ && burst.time_ms - *last_burst_ms_ < kLeastApartMs;
  last_burst_ms_ = burst.time_ms;
  if (is_quick) {
    ++too_quick_;
    return std::nullopt;
  }
  ++bursts_;
  std::optional<double>& last_ms = last_ms_[burst.on ? 1 : 0];
  if (last_ms) {
    periods_ms_.push_back(burst.time_ms - *last_ms);
    if (periods_ms_.size() > kPeriods) periods_ms_.pop_front();
  }
  last_ms = burst.time_ms;
  return burst;
}

double BurstFinder::BlinkHz() const {
  if (periods_ms_.size() < 3) return 0;
  return 1e3 / UpperMedian(std::vector<double>(periods_ms_.begin(), periods_ms_.end()));
}

void FlickerMeter::Take(int64_t time_us, bool on) {
  if (!begin_us_) begin_us_ = time_us;
  const int64_t bin = (time_us - *begin_us_) / kBinUs;
  if (bin < 0 || bin >= static_cast<int64_t>(kBins)) return;
  net_[static_cast<size_t>(bin)] += on ? 1.0f : -1.0f;
}

void FlickerMeter::Forget(int64_t begin_us, int64_t end_us) {
  if (!begin_us_) return;
  const int64_t first = std::max<int64_t>(0, (begin_us - *begin_us_) / kBinUs);
  const int64_t last =
      std::min<int64_t>(static_cast<int64_t>(kBins) - 1, (end_us - *begin_us_) / kBinUs);
  for (int64_t bin = first; bin <= last; ++bin) net_[static_cast<size_t>(bin)] = 0;
}

double FlickerMeter::FlickerHz() const {
  const cv::Mat1f input(1, static_cast<int>(kBins), const_cast<float*>(net_.data()));
  cv::Mat2f spectrum;
  cv::dft(input, spectrum, cv::DFT_COMPLEX_OUTPUT);
  const double hz_per_line = 1e6 / (static_cast<double>(kBinUs) * kBins);
  const int first = static_cast<int>(kLowestFlickerHz / hz_per_line);
  const int last = static_cast<int>(kHighestFlickerHz / hz_per_line);
  std::vector<double> powers;
  int strongest = first;
  const auto power = [&](int line) {
    const cv::Vec2f value = spectrum(0, line);
    return static_cast<double>(value[0] * value[0] + value[1] * value[1]);
  };
  for (int line = first; line <= last; ++line) {
    powers.push_back(power(line));
    if (power(line) > power(strongest)) strongest = line;
  }
  const double most = power(strongest);
  if (!(most > kFlickerOverNoise * UpperMedian(std::move(powers))) || !(most > 0)) return 0;
  // Between the lines, by the powers beside it.
  const double before = power(strongest - 1), after = power(strongest + 1);
  const double shift = (after - before) / (before + most + after);
  return (strongest + shift) * hz_per_line;
}

}  // namespace rigcal::agent
