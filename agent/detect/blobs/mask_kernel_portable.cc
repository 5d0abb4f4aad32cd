// SPDX-License-Identifier: Apache-2.0
// Written so that a compiler turns each loop into whatever vectors the target has.
#include <algorithm>
#include <bit>
#include <cstring>

#include "agent/detect/blobs/mask_kernel.h"

namespace rigcal::agent {
namespace {

constexpr int kLanes = 16;
constexpr int kBlock = 64;  // pixels of a word
constexpr int kCacheLine = 64;

using Bytes = uint8_t __attribute__((vector_size(kLanes)));

Bytes Load(const uint8_t* bytes) {
  Bytes loaded;
  std::memcpy(&loaded, bytes, sizeof(loaded));
  return loaded;
}

// The low half of `a` interleaved with the high half of `b`, and so on.
Bytes LowHigh(Bytes a, Bytes b) {
  return __builtin_shuffle(a, b, Bytes{0, 24, 1, 25, 2, 26, 3, 27, 4, 28, 5, 29, 6, 30, 7, 31});
}
Bytes HighLow(Bytes a, Bytes b) {
  return __builtin_shuffle(a, b,
                           Bytes{8, 16, 9, 17, 10, 18, 11, 19, 12, 20, 13, 21, 14, 22, 15, 23});
}

// 16 pixels. Byte i of the 48 moves to 2 i modulo 47 in each round; after four rounds it has moved
// to 16 i modulo 47, which is where its plane wants it.
void Deinterleave(const uint8_t* pixels, uint8_t* blue, uint8_t* green, uint8_t* red) {
  Bytes a = Load(pixels);
  Bytes b = Load(pixels + kLanes);
  Bytes c = Load(pixels + 2 * kLanes);
  for (int round = 0; round < 4; ++round) {
    const Bytes first = LowHigh(a, b);
    const Bytes second = HighLow(a, c);
    c = LowHigh(b, c);
    a = first;
    b = second;
  }
  std::memcpy(blue, &a, sizeof(a));
  std::memcpy(green, &b, sizeof(b));
  std::memcpy(red, &c, sizeof(c));
}

// Whether any of `count` (a multiple of 16) bytes is larger than `below`.
bool AnyAbove(const uint8_t* bytes, int count, uint8_t below) {
  uint8_t largest[kLanes] = {};
  for (int i = 0; i < count; i += kLanes) {
    for (int k = 0; k < kLanes; ++k) largest[k] = std::max(largest[k], bytes[i + k]);
  }
  uint8_t above[kLanes];
  for (int k = 0; k < kLanes; ++k) above[k] = largest[k] > below ? 1 : 0;
  uint64_t halves[2];
  std::memcpy(halves, above, sizeof(halves));
  return (halves[0] | halves[1]) != 0;
}

// 64 bytes of 0 or 1 to bits.
uint64_t Pack(const uint8_t* taken) {
  static_assert(std::endian::native == std::endian::little);
  uint64_t word = 0;
  for (int i = 0; i < kBlock / 8; ++i) {
    uint64_t eight = 0;
    std::memcpy(&eight, taken + 8 * i, sizeof(eight));
    word |= (eight * 0x0102040810204080u >> 56) << (8 * i);
  }
  return word;
}

struct Planes {
  alignas(64) uint8_t channel[3][kBlock];
};

// inside[i] becomes 0 where the hue lies in another half plane.
void KeepHalfPlane(const HueHalfPlane& plane, const Planes& planes, uint8_t* inside) {
  const uint8_t* plus = planes.channel[plane.plus];
  const uint8_t* minus = planes.channel[plane.minus];
  const uint8_t* slope_plus = planes.channel[plane.slope_plus];
  const uint8_t* slope_minus = planes.channel[plane.slope_minus];
  const int16_t slope = plane.slope;
  for (int i = 0; i < kBlock; ++i) {
    const auto run = static_cast<int16_t>(slope_plus[i] - slope_minus[i]);
    const auto rise = static_cast<int16_t>(plus[i] - minus[i]);
    const uint8_t above = rise > static_cast<int16_t>(run * slope >> 16) ? 1 : 0;
    inside[i] &= above;
  }
}

uint64_t HueInRange(const IntegerColourRange& range, const Planes& planes) {
  alignas(64) uint8_t inside[kBlock];
  std::fill(inside, inside + kBlock, uint8_t{1});
  KeepHalfPlane(range.from, planes, inside);
  KeepHalfPlane(range.to, planes, inside);
  return Pack(inside) ^ (range.outside ? ~uint64_t{0} : 0);
}

// Most bright pixels have too little colour: only where one has enough is its hue asked for.
uint64_t MaskBlock(const IntegerColourRange& range, const uint8_t* pixels) {
  Planes planes;
  for (int i = 0; i < kBlock; i += kLanes) {
    Deinterleave(pixels + 3 * i, planes.channel[kBlue] + i, planes.channel[kGreen] + i,
                 planes.channel[kRed] + i);
  }
  alignas(64) uint8_t coloured[kBlock];  // and bright enough
  alignas(64) uint8_t plain[kBlock];     // taken whatever the hue
  const uint8_t takes_grey = range.takes_grey ? 1 : 0;
  const uint8_t value_below = range.value_below;
  const uint8_t washed_out_below = range.washed_out_below;
  const uint16_t grey_share = range.grey_share;
  for (int i = 0; i < kBlock; ++i) {
    const uint8_t blue = planes.channel[kBlue][i];
    const uint8_t green = planes.channel[kGreen][i];
    const uint8_t red = planes.channel[kRed][i];
    const uint8_t value = std::max(std::max(blue, green), red);
    const uint8_t smallest = std::min(std::min(blue, green), red);
    const auto limit = static_cast<uint8_t>(uint32_t{value} * grey_share >> 16);
    const uint8_t bright = value > value_below ? 1 : 0;
    const uint8_t colourful = smallest <= limit ? 1 : 0;
    const uint8_t colourless = smallest == value ? 1 : 0;
    const uint8_t washed_out = smallest > washed_out_below ? 1 : 0;
    coloured[i] = bright & colourful;
    plain[i] = bright & (washed_out | (colourless & takes_grey));
  }
  const uint64_t candidates = Pack(coloured);
  const uint64_t in_range = candidates == 0 ? 0 : HueInRange(range, planes);
  return (candidates & in_range) | Pack(plain);
}

// The lines that lie `ahead` bytes after `count` bytes, where no object need be.
void Prefetch(const uint8_t* bytes, ptrdiff_t ahead, int count) {
  const uintptr_t first = reinterpret_cast<uintptr_t>(bytes) + static_cast<uintptr_t>(ahead);
  for (int i = 0; i < count; i += kCacheLine) {
    const uintptr_t address = first + static_cast<uintptr_t>(i);
    __builtin_prefetch(reinterpret_cast<const void*>(address));
  }
}

uint64_t MaskBgr(const IntegerColourRange& range, const uint8_t* pixels, ptrdiff_t next_row,
                 int word_count, uint64_t* words) {
  uint64_t all = 0;
  for (int i = 0; i < word_count; ++i, pixels += 3 * kBlock) {
    Prefetch(pixels, next_row, 3 * kBlock);
    words[i] = AnyAbove(pixels, 3 * kBlock, range.value_below) ? MaskBlock(range, pixels) : 0;
    all |= words[i];
  }
  return all;
}

uint64_t MaskMono(const IntegerColourRange& range, const uint8_t* pixels, ptrdiff_t next_row,
                  int word_count, uint64_t* words) {
  uint64_t all = 0;
  for (int i = 0; i < word_count; ++i, pixels += kBlock) {
    Prefetch(pixels, next_row, kBlock);
    words[i] = 0;
    if (!AnyAbove(pixels, kBlock, range.value_below)) continue;
    uint8_t taken[kBlock];
    for (int k = 0; k < kBlock; ++k) taken[k] = pixels[k] > range.value_below ? 1 : 0;
    words[i] = Pack(taken);
    all |= words[i];
  }
  return all;
}

}  // namespace

extern const MaskKernel kPortableMaskKernel;
const MaskKernel kPortableMaskKernel = {"portable", MaskBgr, MaskMono};

}  // namespace rigcal::agent
