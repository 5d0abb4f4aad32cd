// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_kernel.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace rigcal::agent::blink_kernel_test {
namespace {

// The rules, one event at a time.
void UpdateOne(const BlinkRules& rules, const PackedEvent& event, std::vector<uint32_t>* states,
               std::vector<uint32_t>* tiles) {
  uint32_t& state = (*states)[event.y() * rules.stride + event.x];
  const uint32_t now = event.time_us >> rules.shift;
  const uint32_t gap = (now - (state >> 16)) & 0xffff;
  const bool was_on = (state & BlinkRules::kOnBit) != 0;
  if (event.on() == (rules.flip != 0)) {
    state &= ~BlinkRules::kOnBit;
    return;
  }
  if (gap < rules.min_gap + (was_on ? rules.again_gap : 0)) {
    state |= BlinkRules::kOnBit;
    return;
  }
  uint32_t periods = 0;
  if (was_on == (rules.needs_off == 0) && gap >= rules.low_gap &&
      gap <= rules.low_gap + rules.band_gap) {
    periods = std::min(state % 8 + 1, 7u);
  }
  state = now << 16 | std::min(gap, BlinkRules::kMaxGap) << 4 | BlinkRules::kOnBit | periods;
  if (periods < rules.min_periods) return;
  (*tiles)[event.y() / 16 * rules.tile_columns + event.x / 16] = event.time_us | 1;
}

struct Sensor {
  uint32_t width, height;
};

// `shift` decides on what else there is, too.
BlinkRules MakeRules(uint32_t width, int shift, uint32_t min_periods) {
  constexpr uint32_t kPolarity = 1u << 31;
  return {.shift = shift,
          .stride = width,
          .tile_columns = (width + 15) / 16,
          .min_gap = 300,
          .again_gap = 250,
          .low_gap = 850,
          .band_gap = 300,
          .min_periods = min_periods,
          .flip = shift % 2 == 0 ? 0 : kPolarity,
          .needs_off = shift == 1 ? 0 : kPolarity};
}

TEST(BlinkKernel, ThePortableOneIsAlwaysThere) {
  EXPECT_STREQ(AvailableBlinkKernels().front()->name, "portable");
  EXPECT_STREQ(AvailableBlinkKernels().back()->name, BestBlinkKernel().name);
}

// Few pixels, so that many of the events taken together are of the same; counts of every remainder;
// time steps that reach every case of the rules.
TEST(BlinkKernel, EveryKernelTakesEventsOneAfterTheOther) {
  std::mt19937 random(3);
  for (const Sensor& sensor :
       {Sensor{3, 2}, Sensor{40, 5}, Sensor{2048, 2048}, Sensor{1280, 720}}) {
    for (int shift = 0; shift < 4; ++shift) {
      const BlinkRules rules = MakeRules(sensor.width, shift, shift < 2 ? 1 : 2);
      const size_t pixels = size_t{sensor.width} * sensor.height;
      std::vector<uint32_t> start(pixels);
      for (uint32_t& state : start) state = static_cast<uint32_t>(random());
      const std::vector<uint32_t> no_tiles(size_t{rules.tile_columns} * (sensor.height / 16 + 1));
      std::vector<std::vector<PackedEvent>> chunks;
      auto time_us = static_cast<uint32_t>(random());
      for (size_t count = 0; count < 150; ++count) {
        std::vector<PackedEvent>& chunk = chunks.emplace_back();
        for (size_t i = 0; i < count; ++i) {
          const uint32_t longest = random() % 3 == 0 ? 1400u << shift : 3u;
          time_us += static_cast<uint32_t>(random()) % longest;
          const auto y = static_cast<uint32_t>(random()) % std::min(sensor.height, 2048u);
          chunk.push_back({time_us, static_cast<uint16_t>(random() % sensor.width),
                           static_cast<uint16_t>(y | (random() & 1) << 15)});
        }
      }
      std::vector<uint32_t> expected = start, expected_tiles = no_tiles;
      for (const auto& chunk : chunks) {
        for (const PackedEvent& event : chunk) {
          UpdateOne(rules, event, &expected, &expected_tiles);
        }
      }
      for (const BlinkKernel* kernel : AvailableBlinkKernels()) {
        std::vector<uint32_t> states = start, tiles = no_tiles;
        for (const auto& chunk : chunks) {
          kernel->update(rules, chunk.data(), chunk.size(), states.data(), tiles.data());
        }
        EXPECT_TRUE(states == expected) << kernel->name << ", " << sensor.width << ", " << shift;
        EXPECT_TRUE(tiles == expected_tiles)
            << kernel->name << ", " << sensor.width << ", " << shift;
      }
      if (sensor.width < 100) {
        EXPECT_NE(expected_tiles, no_tiles);
      }
    }
  }
}

TEST(BlinkKernel, EveryKernelForgetsWhatHasBeenSilent) {
  std::mt19937 random(4);
  for (size_t count = 0; count < 70; ++count) {
    const auto now = static_cast<uint32_t>(random());
    std::vector<uint32_t> start(count + 1);
    for (uint32_t& state : start) state = static_cast<uint32_t>(random());
    if (count > 2) {
      start[0] = (now - BlinkRules::kForgetUnits) << 16 | 0xffff;
      start[1] = (now - BlinkRules::kForgetUnits + 1) << 16 | 0xffff;
    }
    std::vector<uint32_t> expected = start;
    for (size_t i = 0; i < count; ++i) {
      const uint32_t gap = (now - (expected[i] >> 16)) & 0xffff;
      if (gap < BlinkRules::kForgetUnits) continue;
      expected[i] = (now - BlinkRules::kForgetUnits) << 16 | (expected[i] & BlinkRules::kOnBit);
    }
    for (const BlinkKernel* kernel : AvailableBlinkKernels()) {
      std::vector<uint32_t> states = start;
      kernel->sweep(now, states.data(), count);
      EXPECT_EQ(states, expected) << kernel->name;
    }
  }
}

}  // namespace
}  // namespace rigcal::agent::blink_kernel_test
