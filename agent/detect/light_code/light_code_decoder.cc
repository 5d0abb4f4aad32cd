// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/light_code/light_code_decoder.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <utility>

#include "common/light_code/light_code.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::agent {
namespace {

constexpr double kWindowS = 12, kLeastSpanS = 5.5, kAttemptEveryS = 1;
constexpr size_t kLeastSamples = 60;
// Two kinds of levels lie so many of their own sigmas apart. Half of all samples of a slow camera
// show a bit's end, so that this is little.
constexpr double kLeastSeparation = 2.5;
// Noise alone comes to 3.6, and no bits say there that it is none: levels of a camera that is too
// slow are a code's if they lie so many sigmas apart, and by so much.
constexpr double kSureSeparation = 6, kLeastDifference = 0.1;
constexpr double kMostContrast = 1.5;  // beyond it a level says no more

constexpr double kMostDrift = 0.03;  // of the wand's clock
constexpr double kDriftStep = 0.001, kPhaseStep = 0.1;
constexpr double kFollowedDrift = 0.003;  // since the last reading
constexpr double kFineDriftStep = 0.0002, kFinePhaseStep = 0.02;
constexpr double kEdge = 0.15;            // of a bit: samples nearer to its ends count less
constexpr double kLeastCertainty = 0.25;  // of a bit's mean contrast; less is not known
constexpr double kFalseReadings = 1e-9;   // of all attempts on noise
// The bits are known then: all drifts and phases with which as few samples disagree. A camera whose
// frames fall on the same places of every bit sees the ends of bits only to within a frame.
constexpr int kFitDrifts = 8, kFitShifts = 20;  // either way
constexpr double kFitDriftStep = 0.0005;
constexpr double kSameFit = 3;  // of the sum of squares, where a sample on the wrong side adds 4
constexpr double kLeastSigmaS = 0.0005;

// A bit that was seen, by its place in the window.
struct SeenBit {
  int place = 0;
  bool dimmed = false;
  double certainty = 0;
};

// What `count` bits of chance would agree in by chance but for `errors` of them or fewer.
double ChanceOf(int count, int errors) {
  double log2_sum = -std::numeric_limits<double>::infinity();
  double log2_ways = 0;
  for (int e = 0; e <= errors; ++e) {
    if (e > 0) log2_ways += std::log2(static_cast<double>(count - e + 1) / e);
    const double larger = std::max(log2_sum, log2_ways);
    log2_sum = larger + std::log2(std::exp2(log2_sum - larger) + std::exp2(log2_ways - larger));
  }
  return std::exp2(log2_sum - count);
}

struct Equation {
  uint32_t combination = 0;
  bool value = false;
};

// Gauss elimination modulo 2 over the bits in their order, until the state is known.
class StateSolver {
 public:
  // False: it follows from those before.
  bool Add(Equation equation) {
    for (const Equation& row : rows_) {
      if ((equation.combination & LowestBit(row.combination)) == 0) continue;
      equation.combination ^= row.combination;
      equation.value ^= row.value;
    }
    if (equation.combination == 0) return false;
    const uint32_t pivot = LowestBit(equation.combination);
    for (Equation& row : rows_) {
      if ((row.combination & pivot) == 0) continue;
      row.combination ^= equation.combination;
      row.value ^= equation.value;
    }
    rows_.push_back(equation);
    return true;
  }
  bool IsComplete() const { return rows_.size() == kLightCodeDegree; }
  uint32_t State() const {
    uint32_t state = 0;
    for (const Equation& row : rows_) {
      if (row.value) state |= LowestBit(row.combination);
    }
    return state;
  }

 private:
  static uint32_t LowestBit(uint32_t word) { return word & (~word + 1); }
  std::vector<Equation> rows_;
};

struct FoundCode {
  uint32_t wand = 0, state = 0;
};

// The state that the bits follow from, by certainty; one of the bits that it is taken from may be
// wrong. None: too many of the others disagree.
std::optional<uint32_t> SolveState(std::span<const SeenBit> bits,
                                   const std::vector<uint32_t>& combinations) {
  const auto combination = [&](const SeenBit& bit) {
    return combinations[static_cast<size_t>(bit.place)];
  };
  std::vector<SeenBit> basis, others;
  StateSolver ranks;
  for (const SeenBit& bit : bits) {
    const bool is_new = !ranks.IsComplete() && ranks.Add({combination(bit), bit.dimmed});
    (is_new ? basis : others).push_back(bit);
  }
  if (!ranks.IsComplete()) return std::nullopt;
  constexpr double kTries = (kLightCodeDegree + 1) * kMaxWandNumber;
  const int count = static_cast<int>(others.size());
  for (size_t wrong = 0; wrong <= basis.size(); ++wrong) {
    StateSolver solver;
    for (size_t i = 0; i < basis.size(); ++i) {
      solver.Add({combination(basis[i]), basis[i].dimmed != (i + 1 == wrong)});
    }
    const uint32_t state = solver.State();
    const int errors = static_cast<int>(std::ranges::count_if(others, [&](const SeenBit& bit) {
      return (std::popcount(combination(bit) & state) % 2 != 0) != bit.dimmed;
    }));
    if (state != 0 && kTries * ChanceOf(count, errors) < kFalseReadings) return state;
  }
  return std::nullopt;
}

std::optional<FoundCode> FindCode(std::vector<SeenBit> bits) {
  if (bits.empty()) return std::nullopt;
  const int count = std::ranges::max(bits, {}, &SeenBit::place).place + 1;
  std::ranges::stable_sort(bits, std::greater(), &SeenBit::certainty);
  for (uint32_t wand = 1; wand <= kMaxWandNumber; ++wand) {
    const auto state = SolveState(bits, LightCode::Of(wand).Combinations(count));
    if (state) return FoundCode{wand, *state};
  }
  return std::nullopt;
}

}  // namespace

ClockSample ToClockSample(const LightCodeReading& reading) {
  return {.device_ns = reading.camera_time_ns,
          .uncertainty_ns = static_cast<uint32_t>(std::lround(1e9 * reading.sigma_s)),
          .light = reading.wand,
          .light_ns = reading.wand_time_ns};
}

void LightCodeDecoder::Add(int64_t camera_time_ns, double level) {
  if (!std::isfinite(level)) return;
  double time_s = 1e-9 * static_cast<double>(camera_time_ns - origin_ns_);
  if (samples_.empty() || time_s <= samples_.back().time_s ||
      time_s > samples_.back().time_s + kWindowS) {
    samples_.clear();
    origin_ns_ = camera_time_ns;
    time_s = attempted_s_ = 0;
    state_ = LightCodeState::kNone;
    last_rate_ = 0;
  }
  samples_.push_back({time_s, level});
  if (time_s < attempted_s_ + kAttemptEveryS) return;
  attempted_s_ = time_s;
  std::erase_if(samples_, [&](const Sample& sample) { return sample.time_s < time_s - kWindowS; });
  Attempt();
}

std::vector<LightCodeReading> LightCodeDecoder::Take() { return std::exchange(readings_, {}); }

std::vector<double> LightCodeDecoder::Contrast(bool* is_sure) const {
  std::vector<double> levels;
  for (const Sample& sample : samples_) levels.push_back(sample.level);
  std::ranges::sort(levels);
  // The threshold in the middle of the two means (Ridler and Calvard 1978).
  double low = levels[levels.size() / 10], high = levels[levels.size() - 1 - levels.size() / 10];
  for (int round = 0; round < 10; ++round) {
    const auto split = std::ranges::lower_bound(levels, 0.5 * (low + high));
    const std::vector<double> below(levels.begin(), split), above(split, levels.end());
    if (below.empty() || above.empty()) return {};
    low = LowerMedian(below);
    high = LowerMedian(above);
  }
  std::vector<double> off;
  for (const double level : levels)
    off.push_back(std::min(std::abs(level - low), std::abs(level - high)));
  const double sigma = kSigmaOverMad * LowerMedian(off);
  if (!(high - low > kLeastSeparation * sigma) || !(high > low)) return {};
  *is_sure = high - low > kSureSeparation * sigma && high - low > kLeastDifference;
  std::vector<double> contrast;
  for (const Sample& sample : samples_) {
    contrast.push_back(
        std::clamp((2 * sample.level - low - high) / (high - low), -kMostContrast, kMostContrast));
  }
  return contrast;
}

LightCodeDecoder::BitClock LightCodeDecoder::FindClock(const std::vector<double>& contrast) const {
  std::vector<double> sums, counts;
  // The sum of squares between the bits.
  const auto score = [&](const BitClock& clock) {
    const double from = std::floor(clock.At(samples_.front().time_s));
    const auto bits = static_cast<size_t>(clock.At(samples_.back().time_s) - from) + 1;
    sums.assign(bits, 0);
    counts.assign(bits, 0);
    for (size_t i = 0; i < samples_.size(); ++i) {
      const auto bit = static_cast<size_t>(clock.At(samples_[i].time_s) - from);
      sums[bit] += contrast[i];
      ++counts[bit];
    }
    double sum = 0;
    for (size_t bit = 0; bit < bits; ++bit) {
      if (counts[bit] > 0) sum += sums[bit] * sums[bit] / counts[bit];
    }
    return sum;
  };
  BitClock best;
  double best_score = -1;
  const double middle_s = MiddleS();
  // `phase`: in the middle of the window, so that the two do not depend on each other.
  const auto try_clock = [&](double rate, double phase) {
    BitClock clock{rate / kLightCodeBitS, 0};
    clock.phase = phase - clock.At(middle_s);
    const double value = score(clock);
    if (value > best_score) best_score = value, best = clock;
  };
  const double centre = last_rate_ > 0 ? last_rate_ : 1;
  const double reach = last_rate_ > 0 ? kFollowedDrift : kMostDrift;
  const int steps = static_cast<int>(std::lround(reach / kDriftStep));
  for (int step = -steps; step <= steps; ++step) {
    for (double phase = 0; phase < 1; phase += kPhaseStep) {
      try_clock(centre + step * kDriftStep, phase);
    }
  }
  const double rate = best.bits_per_s * kLightCodeBitS, phase = best.At(middle_s);
  for (double drift = -kDriftStep; drift <= kDriftStep; drift += kFineDriftStep) {
    for (double shift = -kPhaseStep; shift <= kPhaseStep; shift += kFinePhaseStep) {
      try_clock(rate + drift, phase + shift);
    }
  }
  return best;
}

std::optional<LightCodeReading> LightCodeDecoder::Read(const std::vector<double>& contrast) const {
  const BitClock clock = FindClock(contrast);
  const double from = std::floor(clock.At(samples_.front().time_s));
  const auto count = static_cast<size_t>(clock.At(samples_.back().time_s) - from) + 1;
  std::vector<double> sums(count, 0), weights(count, 0);
  for (size_t i = 0; i < samples_.size(); ++i) {
    const double at = clock.At(samples_[i].time_s) - from;
    const double within = at - std::floor(at);
    const double weight = std::clamp(std::min(within, 1 - within) / kEdge, 0.05, 1.0);
    sums[static_cast<size_t>(at)] += weight * contrast[i];
    weights[static_cast<size_t>(at)] += weight;
  }
  std::vector<SeenBit> bits;
  for (size_t bit = 0; bit < count; ++bit) {
    if (!(weights[bit] > 0)) continue;
    const double mean = sums[bit] / weights[bit];
    if (std::abs(mean) < kLeastCertainty) continue;
    bits.push_back({static_cast<int>(bit), mean < 0, std::min(1.0, std::abs(mean))});
  }
  const std::optional<FoundCode> found = FindCode(std::move(bits));
  if (!found) return std::nullopt;
  const LightCode& code = LightCode::Of(found->wand);
  const std::optional<int64_t> state_at = code.IndexOf(found->state);
  if (!state_at) return std::nullopt;
  // A window that began before the wand did has the last indices of the code before its first.
  const bool is_before = *state_at + static_cast<int64_t>(count) > kLightCodeLength;
  const int64_t first_bit = is_before ? *state_at - kLightCodeLength : *state_at;
  const Fit fit = FitTo(contrast, clock, [&](double place) {
    return code.Bit(first_bit + static_cast<int64_t>(std::floor(place - from)));
  });
  const double middle_s = MiddleS();
  const double wand_s =
      (fit.clock.At(middle_s) - from + static_cast<double>(first_bit)) * kLightCodeBitS;
  if (wand_s < 0) return std::nullopt;
  return LightCodeReading{.wand = found->wand,
                          .camera_time_ns = origin_ns_ + std::llround(1e9 * middle_s),
                          .wand_time_ns = std::llround(1e9 * wand_s),
                          .sigma_s = fit.sigma_s,
                          .wand_rate = fit.clock.bits_per_s * kLightCodeBitS};
}

LightCodeDecoder::Fit LightCodeDecoder::FitTo(
    const std::vector<double>& contrast, const BitClock& clock,
    absl::FunctionRef<bool(double place)> is_dimmed) const {
  const double middle_s = MiddleS();
  struct Trial {
    double drift, shift, misfit;
  };
  std::vector<Trial> trials;
  double least = std::numeric_limits<double>::infinity();
  for (int i = -kFitDrifts; i <= kFitDrifts; ++i) {
    for (int j = -kFitShifts; j <= kFitShifts; ++j) {
      const double drift = i * kFitDriftStep, shift = j * kFinePhaseStep;
      double misfit = 0;
      for (size_t k = 0; k < samples_.size(); ++k) {
        const double since_s = samples_[k].time_s - middle_s;
        const double place =
            clock.At(samples_[k].time_s) + shift + drift / kLightCodeBitS * since_s;
        const double off = contrast[k] - (is_dimmed(place) ? -1 : 1);
        misfit += off * off;
      }
      least = std::min(least, misfit);
      trials.push_back({drift, shift, misfit});
    }
  }
  double drift = 0, shift = 0, count = 0, first = 1, last = -1;
  for (const Trial& trial : trials) {
    if (trial.misfit > least + kSameFit) continue;
    drift += trial.drift;
    shift += trial.shift;
    ++count;
    first = std::min(first, trial.shift);
    last = std::max(last, trial.shift);
  }
  drift /= count;
  shift /= count;
  Fit fit{{clock.bits_per_s + drift / kLightCodeBitS, 0}, 0};
  fit.clock.phase = clock.At(middle_s) + shift - fit.clock.At(middle_s);
  const double width_s = (last - first + kFinePhaseStep) * kLightCodeBitS;
  fit.sigma_s = std::max(kLeastSigmaS, width_s / std::sqrt(12.0));
  return fit;
}

void LightCodeDecoder::Attempt() {
  if (samples_.size() < 3) return;
  std::vector<double> steps_s;
  for (size_t i = 1; i < samples_.size(); ++i) {
    steps_s.push_back(samples_[i].time_s - samples_[i - 1].time_s);
  }
  frame_rate_hz_ = 1 / LowerMedian(std::move(steps_s));
  if (samples_.back().time_s - samples_.front().time_s < kLeastSpanS) return;
  bool is_sure = false;
  const std::vector<double> contrast = Contrast(&is_sure);
  state_ = contrast.empty() ? LightCodeState::kNone : LightCodeState::kSeen;
  if (contrast.empty()) return;
  if (frame_rate_hz_ < 0.98 * kLeastRateHz) {
    state_ = is_sure ? LightCodeState::kTooSlow : LightCodeState::kNone;
    return;
  }
  if (samples_.size() < kLeastSamples) return;
  const std::optional<LightCodeReading> reading = Read(contrast);
  if (!reading) return;
  state_ = LightCodeState::kRead;
  last_rate_ = reading->wand_rate;
  readings_.push_back(*reading);
}

}  // namespace rigcal::agent
