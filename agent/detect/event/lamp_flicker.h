// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <complex>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "agent/event/event.h"
#include "agent/event/event_words.h"

namespace rigcal::agent {

// When a lamp on the mains flickered: its light rises fastest at `time_us` and whole thirds of
// `period_us` before and after. Thirds, because lamps of one room hang on three phases of the
// mains.
struct LampReading {
  int64_t time_us =
      0;  // the sensor's clock; within a sixth of a period from the middle of a second
  double period_us = 0;  // 10 000 or 8333, and what the mains deviate by
  double sigma_us = 0;   // one sigma of time_us, noise and differences between parts of the image
};

// Reads the phase of lamps that flicker at 100 or 120 Hz, twice the frequency of the mains, from
// the events of one camera. All cameras of a room see one phase, so it compares their clocks.
//
// ON less OFF events are counted in cells of 0.5 ms and blocks of the image; of a second of them
// the component of each of the two frequencies is taken (a Fourier coefficient with a Hann window,
// Harris 1978, "On the use of windows for harmonic analysis with the discrete Fourier transform").
// It is one of a lamp where it stands out from components 4 to 8 Hz beside it. Three times its
// angle is the same for lamps on any phase of the mains; the blocks' weighted mean of that is read.
// The change of the angles from second to second gives the period, up to 0.35 Hz beside the nominal
// one. A wand that blinks at another frequency is outside of the window's reach.
//
// Of batches of many events every eighth one is counted. One thread at a time.
class LampFlicker {
 public:
  explicit LampFlicker(const SensorGeometry& geometry);

  // Seconds are counted from here on; what the unfinished one has seen is dropped.
  void Restart(int64_t time_us);
  // Events of up to about 2^31 us after the last ones, not sorted within some cells.
  void Take(std::span<const PackedEvent> events) {
    if (events.empty()) return;
    if (EndOfCell(events.back()) <= 0) [[unlikely]] {
      TakeAcrossCells(events);
      return;
    }
    is_empty_ = false;
    const size_t stride = events.size() < kManyEvents ? 1 : kStride;
    for (size_t i = 0; i < events.size(); i += stride) Count(events[i], static_cast<int>(stride));
  }
  // Of each frequency, each second in which there was a lamp and that follows another such; in
  // order of seconds. Those that were not taken before.
  std::vector<LampReading> TakeReadings();

 private:
  static constexpr size_t kManyEvents = 256, kStride = 8;
  static constexpr int kSideBits = 4;  // of a block's column, and of its row
  static constexpr size_t kBlocks = size_t{1} << 2 * kSideBits;
  static constexpr int64_t kCellUs = 500, kCells = 2000;
  static constexpr std::array<double, 2> kLampHz = {100, 120};
  static constexpr std::array<double, 6> kBesideHz = {-8, -6, -4, 4, 6, 8};
  static constexpr size_t kPerLamp = 1 + kBesideHz.size();
  using Blocks = std::array<std::complex<float>, kBlocks>;
  struct Component {
    double hz = 0;
    std::array<float, kBlocks> real{}, imaginary{};
    std::complex<double> Of(size_t block) const { return {real[block], imaginary[block]}; }
  };

  // Time from the event to the end of the cell that is counted.
  int32_t EndOfCell(const PackedEvent& event) const {
    return static_cast<int32_t>(static_cast<uint32_t>(cell_end_us_) - event.time_us);
  }
  void Count(const PackedEvent& event, int weight) {
    const size_t block = static_cast<size_t>(event.y() >> row_shift_) << kSideBits |
                         static_cast<size_t>(event.x >> column_shift_);
    counts_[block % kBlocks] += event.on() ? weight : -weight;
  }
  void TakeAcrossCells(std::span<const PackedEvent> events);
  void EndCell();
  void AddCell();
  void EndSecond();
  std::optional<LampReading> ReadingOf(size_t lamp);

  int column_shift_ = 0, row_shift_ = 0;
  int64_t cell_end_us_ = kCellUs;
  int64_t cell_ = 0;                             // of this second
  bool is_empty_ = true;                         // of this cell
  std::array<int, kBlocks> counts_{};            // of this cell
  std::vector<Component> components_;            // of each lamp: itself, then those beside it
  std::array<Blocks, kLampHz.size()> before_{};  // of the last second, of each lamp
  std::vector<LampReading> readings_;
};

}  // namespace rigcal::agent
