// SPDX-License-Identifier: Apache-2.0
#include "agent/event/evt3_kernel.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <random>
#include <tuple>
#include <vector>

#include "agent/event/evt3_decoder.h"

namespace rigcal::agent::evt3_kernel_test {
namespace {

// Output of a decoder in order: kind and values.
using Record = std::tuple<char, int64_t, uint32_t, uint32_t>;

struct Recorder {
  std::vector<Record> records;

  void Event(uint32_t x, uint32_t y, bool on, uint32_t time_us) {
    records.emplace_back(on ? '+' : '-', time_us, x, y);
  }
  void Vector(uint32_t x, uint32_t y, bool on, uint32_t time_us, uint32_t mask) {
    for (uint32_t k = 0; k < 32; ++k) {
      if ((mask >> k & 1) != 0) Event(x + k, y, on, time_us);
    }
  }
  void Events(std::span<const PackedEvent> events) {
    EXPECT_FALSE(events.empty());
    for (const PackedEvent& event : events) Event(event.x, event.y(), event.on(), event.time_us);
  }
  void Trigger(const TriggerEvent& trigger) {
    records.emplace_back('T', trigger.time_us, trigger.channel, trigger.rising ? 1 : 0);
  }
  void TimeStepBack(int64_t time_us) { records.emplace_back('B', time_us, 0, 0); }
};

using Words = std::vector<uint16_t>;

std::span<const uint8_t> Bytes(const Words& words) {
  return {reinterpret_cast<const uint8_t*>(words.data()), 2 * words.size()};
}

// Decodes chunk by chunk, word by word and with each kernel: every chunk must give the same.
void ExpectSame(SensorGeometry geometry, const std::vector<std::span<const uint8_t>>& chunks) {
  for (const Evt3Kernel* kernel : AvailableEvt3Kernels()) {
    Evt3Decoder plain(geometry), batched(geometry, *kernel);
    for (size_t i = 0; i < chunks.size(); ++i) {
      Recorder expected, seen;
      plain.Decode(chunks[i], expected);
      batched.DecodeInBatches(chunks[i], seen);
      ASSERT_EQ(seen.records.size(), expected.records.size()) << kernel->name << ", chunk " << i;
      for (size_t k = 0; k < expected.records.size(); ++k) {
        ASSERT_EQ(seen.records[k], expected.records[k])
            << kernel->name << ", chunk " << i << ", record " << k;
      }
      ASSERT_EQ(batched.faults(), plain.faults()) << kernel->name << ", chunk " << i;
      ASSERT_EQ(batched.time_us(), plain.time_us()) << kernel->name << ", chunk " << i;
    }
  }
}

// Words as a camera sends them, with a `fault_share` of random ones.
Words CameraWords(uint32_t seed, size_t count, SensorGeometry geometry, double vector_share,
                  double fault_share) {
  std::mt19937 random(seed);
  const auto chance = [&random](double share) {
    return static_cast<double>(random()) < share * 4294967296.0;
  };
  Words words;
  uint32_t high = random() & 0xfff, low = 0;
  const auto add = [&words](uint32_t type, uint32_t value) {
    words.push_back(static_cast<uint16_t>(type << 12 | (value & 0xfff)));
  };
  add(0x8, high);
  add(0x6, low);
  while (words.size() < count) {
    if (chance(fault_share)) words.push_back(static_cast<uint16_t>(random()));
    if (chance(0.2)) {
      low += static_cast<uint32_t>(random() % 300);
      if (low >= 4096) add(0x8, ++high);
      low &= 0xfff;
      add(0x6, low);
    }
    if (chance(0.05)) add(0x8, high);
    add(0x0, static_cast<uint32_t>(random()) % geometry.height);
    const uint32_t polarity = chance(0.5) ? 0x800 : 0;
    if (!chance(vector_share)) {
      do {
        add(0x2, polarity | static_cast<uint32_t>(random()) % geometry.width);
      } while (chance(0.1));
      continue;
    }
    add(0x3, polarity | static_cast<uint32_t>(random()) % geometry.width);
    while (chance(0.7)) add(0x4, chance(0.5) ? 0xfff : static_cast<uint32_t>(random()));
    if (chance(0.5)) add(0x5, static_cast<uint32_t>(random()));
  }
  return words;
}

constexpr std::array<SensorGeometry, 5> kGeometries = {
    {{1280, 720}, {640, 480}, {2048, 2048}, {13, 7}, {1, 1}}};

std::vector<std::span<const uint8_t>> CutAtRandom(const Words& words, size_t longest,
                                                  std::mt19937* random) {
  std::vector<std::span<const uint8_t>> chunks;
  std::span<const uint8_t> rest = Bytes(words);
  while (!rest.empty()) {
    const size_t size = std::min<size_t>(rest.size(), 2 * ((*random)() % longest));
    chunks.push_back(rest.first(size));
    rest = rest.subspan(size);
  }
  return chunks;
}

TEST(Evt3Kernel, ThePortableOneIsAlwaysThere) {
  EXPECT_STREQ(AvailableEvt3Kernels().front()->name, "portable");
  EXPECT_STREQ(AvailableEvt3Kernels().back()->name, BestEvt3Kernel().name);
}

TEST(Evt3Kernel, TakesWhatCamerasSendByItself) {
  constexpr SensorGeometry kGeometry{1280, 720};
  // No vector may reach over the border here.
  Words words;
  for (uint16_t i = 0; i < 200; ++i) {
    const uint16_t y = i, x = static_cast<uint16_t>(0x2800 | i), low = 0x6000 | 77, base = 0x3800;
    words.insert(words.end(), {y, x, x, low, 0x8123, y, base, 0x4fff, 0x4801, 0x5081, 0xe000});
  }
  for (const Evt3Kernel* kernel : AvailableEvt3Kernels()) {
    if (kernel->decode == nullptr) continue;
    Evt3State state{.width = kGeometry.width,
                    .height = kGeometry.height,
                    .high_us = 0x123000,
                    .known_high = 0x8123};
    std::vector<PackedEvent> events(200 * 18 + Evt3Kernel::kRoomEvents);
    const uint8_t* const end = Bytes(words).data() + Bytes(words).size();
    const PackedEvent* const full = events.data() + 200 * 18;
    const Evt3Kernel::Position reached =
        kernel->decode({Bytes(words).data(), events.data()}, end, full, &state);
    EXPECT_LT(end - reached.at, static_cast<ptrdiff_t>(2 * Evt3Kernel::kBlockWords))
        << kernel->name;
    EXPECT_GT(reached.to - events.data(), 195 * 18) << kernel->name;
    EXPECT_EQ(state.time_low, 77u) << kernel->name;
    EXPECT_GE(state.y, 198u) << kernel->name;
  }
}

TEST(Evt3Kernel, StopsWhereTheBufferIsFull) {
  Words words;
  for (int i = 0; i < 4000; ++i) words.insert(words.end(), {0x3000, 0x4fff});
  for (const Evt3Kernel* kernel : AvailableEvt3Kernels()) {
    if (kernel->decode == nullptr) continue;
    Evt3State state{.width = 1280, .height = 720, .known_high = 0x8000};
    constexpr PackedEvent kUntouched{0xdeadbeef, 0xdead, 0xdead};
    std::vector<PackedEvent> events(100 + Evt3Kernel::kRoomEvents + 1, kUntouched);
    const Evt3Kernel::Position reached =
        kernel->decode({Bytes(words).data(), events.data()}, Bytes(words).data() + 16000,
                       events.data() + 100, &state);
    const size_t count = static_cast<size_t>(reached.to - events.data());
    EXPECT_GE(count, 100u) << kernel->name;
    EXPECT_LE(count, 100 + Evt3Kernel::kBlockEvents) << kernel->name;
    EXPECT_EQ(count % 12, 0u) << kernel->name;
    EXPECT_EQ(std::memcmp(&events.back(), &kUntouched, sizeof(kUntouched)), 0) << kernel->name;
  }
}

TEST(Evt3Kernel, DecodesWhatCamerasSend) {
  uint32_t seed = 1;
  for (const SensorGeometry& geometry : kGeometries) {
    for (const double vector_share : {0.0, 0.1, 0.9}) {
      for (const double fault_share : {0.0, 0.001, 0.05}) {
        const Words words = CameraWords(seed++, 20000, geometry, vector_share, fault_share);
        SCOPED_TRACE(::testing::Message() << "seed " << seed - 1);
        ASSERT_NO_FATAL_FAILURE(ExpectSame(geometry, {Bytes(words)}));
      }
    }
  }
}

TEST(Evt3Kernel, DecodesAnyWords) {
  std::mt19937 random(7);
  for (const SensorGeometry& geometry : kGeometries) {
    for (int repetition = 0; repetition < 20; ++repetition) {
      // All types, or few of them, so that blocks without rare ones are met too.
      const uint32_t types = repetition == 0 ? 0xffff : static_cast<uint32_t>(random()) | 0x5;
      Words words = {0x8000, 0x0000};
      while (words.size() < 4000) {
        const auto word = static_cast<uint16_t>(random());
        if ((types >> (word >> 12) & 1) != 0) words.push_back(word);
      }
      ASSERT_NO_FATAL_FAILURE(ExpectSame(geometry, {Bytes(words)})) << repetition;
      ASSERT_NO_FATAL_FAILURE(ExpectSame(geometry, CutAtRandom(words, 60, &random))) << repetition;
    }
  }
}

TEST(Evt3Kernel, CarriesItsStateOverEveryCut) {
  constexpr SensorGeometry kGeometry{640, 480};
  const Words words = CameraWords(11, 300, kGeometry, 0.4, 0.02);
  for (size_t cut = 0; cut <= words.size(); ++cut) {
    ASSERT_NO_FATAL_FAILURE(
        ExpectSame(kGeometry, {Bytes(words).first(2 * cut), Bytes(words).subspan(2 * cut)}))
        << cut;
  }
}

TEST(Evt3Kernel, CountsHalfWords) {
  const Words words = CameraWords(12, 100, {640, 480}, 0.4, 0);
  for (size_t size = 0; size < 100; ++size) {
    ASSERT_NO_FATAL_FAILURE(ExpectSame({640, 480}, {Bytes(words).first(size)})) << size;
  }
}

TEST(Evt3Kernel, PlacesARareWordAnywhereInABlock) {
  constexpr SensorGeometry kGeometry{640, 480};
  const Words words = CameraWords(13, 200, kGeometry, 0.3, 0);
  for (const uint16_t rare : std::initializer_list<uint16_t>{
           0xA601, 0x1000, 0x9abc, 0xffff, 0x7000, 0x01e0, 0x07ff, 0x2280, 0x2fff, 0x3fff, 0x8000,
           0x8fff, 0x8001, 0x5fff, 0x4fff}) {
    for (size_t at = 0; at < 80; ++at) {
      Words with = words;
      with.insert(with.begin() + static_cast<std::ptrdiff_t>(at), rare);
      ASSERT_NO_FATAL_FAILURE(ExpectSame(kGeometry, {Bytes(with)}))
          << std::hex << rare << " " << at;
    }
  }
}

TEST(Evt3Kernel, FollowsABaseFarBehindTheBorder) {
  for (const SensorGeometry& geometry : kGeometries) {
    Words words = {0x8001, 0x0000, 0x3005};
    words.insert(words.end(), 10000, 0x4fff);
    words.insert(words.end(), 100, 0x5001);
    words.insert(words.end(), {0x2000, 0x3000});
    words.insert(words.end(), 100, 0x5001);
    ASSERT_NO_FATAL_FAILURE(ExpectSame(geometry, {Bytes(words)}));
    ASSERT_NO_FATAL_FAILURE(
        ExpectSame(geometry, {Bytes(words).first(2 * 700), Bytes(words).subspan(2 * 700)}));
  }
}

}  // namespace
}  // namespace rigcal::agent::evt3_kernel_test
