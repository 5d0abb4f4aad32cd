// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <optional>
#include <span>

#include "agent/event/event_batcher.h"
#include "agent/event/event_words.h"
#include "agent/event/evt3_kernel.h"
#include "agent/event/time_high.h"

namespace rigcal::agent {

// EVT 3.0: words of 16 bits. A row, a time and a base column hold until the next of their kind.
class Evt3Decoder : public WordDecoder<Evt3Decoder, uint16_t> {
  using Base = WordDecoder<Evt3Decoder, uint16_t>;

 public:
  explicit Evt3Decoder(SensorGeometry geometry, const Evt3Kernel& kernel = BestEvt3Kernel())
      : Base(geometry), kernel_(&kernel) {}

  int64_t time_us() const { return time_high_.time_us() + time_low_; }

  // As Decode does, in batches (see EventBatcher) and by the kernel wherever it can.
  template <typename Consumer>
  void DecodeInBatches(std::span<const uint8_t> bytes, Consumer& consumer);

 private:
  friend Base;
  enum Type : uint32_t {
    kAddressY = 0x0,
    kAddressX = 0x2,
    kVectorBase = 0x3,
    kVector12 = 0x4,
    kVector8 = 0x5,
    kTimeLow = 0x6,
    kContinued4 = 0x7,
    kTimeHigh = 0x8,
    kExternalTrigger = 0xA,
    kOthers = 0xE,
    kContinued12 = 0xF,
  };

  // Where the kernel stops, one of the next kBlockWords words is the reason.
  static constexpr ptrdiff_t kSteppedBytes = Evt3Kernel::kBlockWords * kWordBytes;

  // In pixels; 0: this is no vector.
  static uint32_t VectorLength(uint32_t word) {
    return word >> 12 == kVector12 ? 12 : word >> 12 == kVector8 ? 8 : 0;
  }
  std::optional<uint32_t> TimeOf(uint32_t word) const {
    if (word >> 12 != kTimeHigh) return std::nullopt;
    return word & 0xfff;
  }
  template <typename Sink>
  void DecodeWords(const uint8_t* at, const uint8_t* stop, const uint8_t* end, Sink& sink);
  bool CanUseKernel() const {
    return row_ok_ && time_high_.known() && geometry_.width <= Evt3State::kMaxWidth &&
           base_x_ <= Evt3State::kMaxBase / 2;
  }
  Evt3Kernel::Position RunKernel(Evt3Kernel::Position from, const uint8_t* end,
                                 const PackedEvent* full);
  void CountUnplaced(uint64_t count) {
    (time_high_.known() ? faults_.outside_geometry : faults_.before_time) += count;
  }

  static constexpr uint32_t kFarColumn = 1u << 30;
  using High = TimeHigh<12, 12>;

  const Evt3Kernel* kernel_;
  High time_high_;
  int64_t high_us_ = 0;
  uint32_t time_low_ = 0;
  uint32_t y_ = 0;
  bool row_ok_ = false;
  uint32_t base_x_ = 0;
  bool base_on_ = false;
};

inline Evt3Kernel::Position Evt3Decoder::RunKernel(Evt3Kernel::Position from, const uint8_t* end,
                                                   const PackedEvent* full) {
  const auto high_us = static_cast<uint32_t>(high_us_);
  Evt3State state{.width = geometry_.width,
                  .height = geometry_.height,
                  .y = y_,
                  .base = base_x_ << 1 | (base_on_ ? 1u : 0u),
                  .time_low = time_low_,
                  .high_us = high_us,
                  .known_high = uint32_t{kTimeHigh} << 12 | (high_us >> 12 & 0xfff)};
  const Evt3Kernel::Position reached = kernel_->decode(from, end, full, &state);
  y_ = state.y;
  base_x_ = state.base >> 1;
  base_on_ = (state.base & 1) != 0;
  time_low_ = state.time_low;
  return reached;
}

template <typename Consumer>
void Evt3Decoder::DecodeInBatches(std::span<const uint8_t> bytes, Consumer& consumer) {
  EventBatcher<Consumer> batcher(&consumer);
  static_assert(EventBatcher<Consumer>::kRoomEvents >= Evt3Kernel::kRoomEvents);
  bytes = WholeWords(bytes);
  const uint8_t* at = bytes.data();
  const uint8_t* const end = at + bytes.size();
  while (at != end) {
    const uint8_t* stop = end;
    if (kernel_->decode != nullptr) {
      if (CanUseKernel()) {
        const Evt3Kernel::Position reached = RunKernel({at, batcher.to()}, end, batcher.full());
        const bool is_full = reached.to >= batcher.full();
        at = reached.at;
        batcher.Wrote(reached.to);
        if (is_full) continue;
      }
      stop = at + std::min(end - at, kSteppedBytes);
    }
    DecodeWords(at, stop, end, batcher);
    at = stop;
  }
  batcher.Flush();
}

template <typename Sink>
void Evt3Decoder::DecodeWords(const uint8_t* at, const uint8_t* const stop,
                              const uint8_t* const end, Sink& sink) {
  // Variables that no store of the sink can alias. Widths are 0 where events cannot be placed.
  uint32_t y = y_, base_x = base_x_, base_on = base_on_ ? 1 : 0;
  uint32_t now = static_cast<uint32_t>(high_us_) + time_low_;
  uint32_t known_width = time_high_.known() ? geometry_.width : 0;
  uint32_t width = row_ok_ ? known_width : 0;
  const uint32_t height = geometry_.height;
  while (at != stop) {
    // Most events are a row and a column: those two words are taken together.
    while (stop - at >= 4) {
      const auto words = LoadWord<uint32_t>(at);
      const uint32_t row = words & 0x7ff, x = words >> 16 & 0x7ff;
      if ((words & 0xf000f000) != 0x20000000 || row >= height || x >= known_width) break;
      y = row;
      width = known_width;
      row_ok_ = true;
      sink.Event(x, y, (words & 0x8000000) != 0, now);
      at += 4;
    }
    if (at == stop) break;
    const uint32_t word = LoadWord<uint16_t>(at);
    at += kWordBytes;
    switch (word >> 12) {
      case kAddressX: {
        const uint32_t x = word & 0x7ff;
        if (x < width) {
          sink.Event(x, y, (word & 0x800) != 0, now);
        } else {
          CountUnplaced(1);
        }
        break;
      }
      case kAddressY:
        y = word & 0x7ff;
        row_ok_ = y < height;
        width = row_ok_ ? known_width : 0;
        break;
      case kVectorBase:
        base_x = word & 0x7ff;
        base_on = word >> 11 & 1;
        // Vectors come behind their base: a branch of their own is predicted better.
        while (at != stop) {
          const uint32_t vector = LoadWord<uint16_t>(at);
          const uint32_t length = VectorLength(vector);
          if (length == 0 || base_x + length > width) break;
          const uint32_t mask = vector & ((1u << length) - 1);
          if (mask != 0) sink.Vector(base_x, y, base_on != 0, now, mask);
          base_x += length;
          at += kWordBytes;
        }
        break;
      case kVector12:
      case kVector8: {
        const uint32_t length = VectorLength(word);
        uint32_t mask = word & ((1u << length) - 1);
        const uint32_t x = base_x;
        base_x += length;
        if (x + length > width) {
          const uint32_t inside = x >= width ? 0 : (1u << (width - x)) - 1;
          CountUnplaced(static_cast<uint64_t>(std::popcount(mask & ~inside)));
          mask &= inside;
          // Vectors without end must not come round to the first column.
          base_x = std::min(base_x, kFarColumn);
        }
        if (mask != 0) sink.Vector(x, y, base_on != 0, now, mask);
        break;
      }
      case kTimeLow:
        time_low_ = word & 0xfff;
        now = static_cast<uint32_t>(high_us_) + time_low_;
        break;
      case kTimeHigh: {
        const auto change = TakeTimeHigh(word & 0xfff, at, end, &time_high_);
        high_us_ = time_high_.time_us();
        if (change == High::Change::kStepBack) {
          sink.TimeStepBack(high_us_);
          time_low_ = 0;
        }
        now = static_cast<uint32_t>(high_us_) + time_low_;
        known_width = geometry_.width;
        width = row_ok_ ? known_width : 0;
        break;
      }
      case kExternalTrigger:
        if (time_high_.known()) {
          sink.Trigger(TriggerEvent{.time_us = high_us_ + time_low_,
                                    .channel = static_cast<uint8_t>(word >> 8 & 0xf),
                                    .rising = (word & 1) != 0});
        } else {
          ++faults_.before_time;
        }
        break;
      case kOthers:
      case kContinued4:
      case kContinued12:
        break;
      default:
        ++faults_.unknown_words;
    }
  }
  y_ = y;
  base_x_ = base_x;
  base_on_ = base_on != 0;
}

template <typename Consumer>
void DecodeInBatches(Evt3Decoder& decoder, std::span<const uint8_t> bytes, Consumer& consumer) {
  decoder.DecodeInBatches(bytes, consumer);
}

}  // namespace rigcal::agent
