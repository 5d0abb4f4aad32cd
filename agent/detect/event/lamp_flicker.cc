// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/lamp_flicker.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace rigcal::agent {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kWindowS = 1;
// A block takes part if its component has this many times the power of those beside it (by chance
// about once in 50 000), and the lamp is one if all that do have this many together.
constexpr double kLeastBlock = 30, kLeastLamp = 300;
constexpr double kLeastNoise = 1;  // of a block: that of one event
// Of the mean of the blocks' tripled angles; 1 if they are equal.
constexpr double kLeastAgreement = 0.6;
// Likewise of the turn from second to second, which is longer if it is not the mains'.
constexpr double kLeastSteadiness = 0.6, kMostTurnHz = 0.35;
// Pixels answer later in less light, alike in all seconds.
constexpr double kLeastSigmaUs = 20;

int ShiftInto(uint32_t side, int bits) {
  int shift = 0;
  while ((std::max(side, 1u) - 1) >> shift >> bits != 0) ++shift;
  return shift;
}

}  // namespace

LampFlicker::LampFlicker(const SensorGeometry& geometry)
    : column_shift_(ShiftInto(geometry.width, kSideBits)),
      row_shift_(ShiftInto(geometry.height, kSideBits)) {
  for (const double hz : kLampHz) {
    components_.push_back({hz});
    for (const double beside_hz : kBesideHz) components_.push_back({hz + beside_hz});
  }
}

void LampFlicker::Restart(int64_t time_us) {
  cell_end_us_ = time_us + kCellUs;
  cell_ = 0;
  counts_.fill(0);
  is_empty_ = true;
  for (Component& component : components_) {
    component.real.fill(0);
    component.imaginary.fill(0);
  }
  for (Blocks& before : before_) before.fill(0);
}

void LampFlicker::TakeAcrossCells(std::span<const PackedEvent> events) {
  for (const PackedEvent& event : events) {
    const int64_t late_us = -static_cast<int64_t>(EndOfCell(event));
    if (late_us > kCells * kCellUs) {
      Restart(cell_end_us_ + late_us);
    } else {
      while (EndOfCell(event) <= 0) EndCell();
    }
    is_empty_ = false;
    Count(event, 1);
  }
}

void LampFlicker::EndCell() {
  if (!is_empty_) AddCell();
  cell_end_us_ += kCellUs;
  if (++cell_ == kCells) EndSecond();
}

void LampFlicker::AddCell() {
  std::array<float, kBlocks> counts;
  std::ranges::copy(counts_, counts.begin());
  const double at = (static_cast<double>(cell_) + 0.5) / kCells;  // of the second
  const double window = 0.5 * (1 - std::cos(kTurn * at));
  for (Component& component : components_) {
    const double angle = -kTurn * component.hz * kWindowS * (at - 0.5);
    const auto real = static_cast<float>(window * std::cos(angle));
    const auto imaginary = static_cast<float>(window * std::sin(angle));
    for (size_t block = 0; block < kBlocks; ++block) {
      component.real[block] += real * counts[block];
      component.imaginary[block] += imaginary * counts[block];
    }
  }
  counts_.fill(0);
  is_empty_ = true;
}

void LampFlicker::EndSecond() {
  for (size_t lamp = 0; lamp < kLampHz.size(); ++lamp) {
    if (const auto reading = ReadingOf(lamp)) readings_.push_back(*reading);
  }
  cell_ = 0;
  for (Component& component : components_) {
    component.real.fill(0);
    component.imaginary.fill(0);
  }
}

std::optional<LampReading> LampFlicker::ReadingOf(size_t lamp) {
  const Component* const components = &components_[lamp * kPerLamp];
  Blocks& before = before_[lamp];
  double total = 0, total_squared = 0, steps = 0;
  std::complex<double> tripled = 0, step = 0;
  for (size_t block = 0; block < kBlocks; ++block) {
    const std::complex<double> seen = components[0].Of(block);
    double noise = 0;
    for (size_t i = 1; i < kPerLamp; ++i) noise += std::norm(components[i].Of(block));
    noise = std::max(kLeastNoise, noise / kBesideHz.size());
    const double power = std::norm(seen) / noise;
    const std::complex<double> last = std::exchange(before[block], std::complex<float>(seen));
    if (power < kLeastBlock) continue;
    const std::complex<double> direction = seen / std::abs(seen);
    total += power;
    total_squared += power * power;
    tripled += power * direction * direction * direction;
    step += seen * std::conj(last) / noise;
    steps += std::abs(seen * last) / noise;
  }
  const double agreement = std::abs(tripled) / total;
  const double hz_beside = std::arg(step) / (kTurn * kWindowS);
  if (total < kLeastLamp || agreement < kLeastAgreement ||
      std::abs(step) < kLeastSteadiness * steps || steps == 0 ||
      std::abs(hz_beside) > kMostTurnHz) {
    return std::nullopt;
  }
  // Of the angle in rad: noise, and how the blocks scatter about their mean (that of tripled angles
  // is 1 - agreement = variance / 2 for small ones) by their effective number.
  const double scatter = 2 * (1 - agreement) / 9;
  const double variance = 0.5 / total + scatter * total_squared / (total * total);
  const double period_us = 1e6 / (kLampHz[lamp] + hz_beside);
  const auto middle_us =
      static_cast<double>(cell_end_us_ - kCellUs) - 0.5 * static_cast<double>(kCells * kCellUs);
  // ON less OFF events go as cos(angle) at the middle: they are most `angle` before it.
  return LampReading{
      .time_us = std::llround(middle_us - std::arg(tripled) / 3 / kTurn * period_us),
      .period_us = period_us,
      .sigma_us = std::hypot(kLeastSigmaUs, std::sqrt(variance) / kTurn * period_us)};
}

std::vector<LampReading> LampFlicker::TakeReadings() { return std::exchange(readings_, {}); }

}  // namespace rigcal::agent
