// SPDX-License-Identifier: Apache-2.0
#pragma once

// The mask kernel, for any instruction set of mask_lanes.h.
#include <cstddef>
#include <cstdint>

#include "agent/detect/blobs/integer_colour_range.h"
#include "agent/detect/blobs/mask_kernel.h"
#include "agent/detect/blobs/mask_lanes.h"

namespace rigcal::agent::RIGCAL_KERNEL {

constexpr int kBlock = 64;  // pixels per word
constexpr int kParts = kBlock / kWidth;
constexpr int kCacheLine = 64;

RIGCAL_INLINE Words InHalfPlane(Words plus, Words minus, Words slope_plus, Words slope_minus,
                                int16_t slope) {
  return plus - minus > MultiplyHighSigned(slope_plus - slope_minus, slope);
}

RIGCAL_INLINE Mask InHalfPlane(const HueHalfPlane& plane, const Planes& planes) {
  const Bytes plus = planes.channel[plane.plus], minus = planes.channel[plane.minus];
  const Bytes slope_plus = planes.channel[plane.slope_plus];
  const Bytes slope_minus = planes.channel[plane.slope_minus];
  return ToMask(PackTruths(
      InHalfPlane(Low(plus), Low(minus), Low(slope_plus), Low(slope_minus), plane.slope),
      InHalfPlane(High(plus), High(minus), High(slope_plus), High(slope_minus), plane.slope)));
}

// Most bright pixels have too little colour: hues are computed only if one pixel has enough.
RIGCAL_INLINE uint64_t MaskBlock(const IntegerColourRange& range, const uint8_t* pixels) {
  const Mask takes_grey = ToMask(Spread(range.takes_grey ? 255 : 0));
  Planes planes[kParts];
  uint64_t not_plain = 0;  // dark, or taken only by its hue
  uint64_t coloured = 0;   // bright enough and with enough colour, so that the hue decides
  for (int i = 0; i < kParts; ++i) {
    planes[i] = Deinterleave(pixels + 3 * i * kWidth);
    const auto [blue, green, red] = planes[i].channel;
    const Bytes value = Max(Max(blue, green), red);
    const Bytes smallest = Min(Min(blue, green), red);
    const Bytes limit = PackLevels(MultiplyHigh(Low(value), range.grey_share),
                                   MultiplyHigh(High(value), range.grey_share));
    const Mask dark = AtMost(value, Spread(range.value_below));
    const Mask grey = Equal(value, smallest) & takes_grey;
    const Mask refused = AtMost(smallest, Spread(range.washed_out_below)) & ~grey;
    not_plain |= ToBits(refused | dark) << (i * kWidth);
    coloured |= ToBits(AtMost(smallest, limit) & ~dark) << (i * kWidth);
  }
  uint64_t taken = ~not_plain;
  if (coloured != 0) {
    uint64_t inside = 0;
    for (int i = 0; i < kParts; ++i) {
      inside |= ToBits(InHalfPlane(range.from, planes[i]) & InHalfPlane(range.to, planes[i]))
                << (i * kWidth);
    }
    taken |= coloured & (range.outside ? ~inside : inside);
  }
  return taken;
}

// Returns, for each place of a register, the largest byte of a block at that place.
template <int kChannels>
RIGCAL_INLINE Bytes Largest(const uint8_t* pixels) {
  Bytes largest = Load(pixels);
  for (int i = 1; i < kChannels * kParts; ++i) {
    largest = Max(largest, Load(pixels + i * kWidth));
  }
  return largest;
}

// Prefetches the lines that lie `ahead` bytes after [bytes, bytes + count); nothing need be there.
RIGCAL_INLINE void Prefetch(const uint8_t* bytes, ptrdiff_t ahead, int count) {
  const uintptr_t first = reinterpret_cast<uintptr_t>(bytes) + static_cast<uintptr_t>(ahead);
  for (int i = 0; i < count; i += kCacheLine) {
    __builtin_prefetch(reinterpret_cast<const void*>(first + static_cast<uintptr_t>(i)));
  }
}

// First tests whether any pixel of a block is bright enough, all channels mixed.
template <bool kNotes>
RIGCAL_INLINE uint64_t MaskBgrRow(const IntegerColourRange& range, const uint8_t* pixels,
                                  ptrdiff_t next_row, int word_count, uint64_t* words,
                                  uint8_t* bright) {
  const Bytes below = Spread(range.value_below);
  uint64_t all = 0;
  for (int i = 0; i < word_count; ++i, pixels += 3 * kBlock) {
    Prefetch(pixels, next_row, 3 * kBlock);
    const bool is_bright = AnyAbove(Largest<3>(pixels), below);
    words[i] = 0;
    if (!is_bright) continue;
    if (kNotes) bright[i] = 1;
    words[i] = MaskBlock(range, pixels);
    all |= words[i];
  }
  return all;
}

inline uint64_t MaskBgr(const IntegerColourRange& range, const uint8_t* pixels, ptrdiff_t next_row,
                        int word_count, uint64_t* words) {
  return MaskBgrRow<false>(range, pixels, next_row, word_count, words, nullptr);
}

inline uint64_t MaskBgrNoting(const IntegerColourRange& range, const uint8_t* pixels,
                              ptrdiff_t next_row, int word_count, uint64_t* words,
                              uint8_t* bright) {
  return MaskBgrRow<true>(range, pixels, next_row, word_count, words, bright);
}

inline uint64_t MaskMono(const IntegerColourRange& range, const uint8_t* pixels, ptrdiff_t next_row,
                         int word_count, uint64_t* words) {
  const Bytes below = Spread(range.value_below);
  uint64_t all = 0;
  for (int i = 0; i < word_count; ++i, pixels += kBlock) {
    Prefetch(pixels, next_row, kBlock);
    words[i] = 0;
    if (kParts > 2 && !AnyAbove(Largest<1>(pixels), below)) continue;
    for (int k = 0; k < kParts; ++k) {
      const uint64_t dark = ToBits(AtMost(Load(pixels + k * kWidth), below));
      words[i] |= (dark ^ (~uint64_t{0} >> (kBlock - kWidth))) << (k * kWidth);
    }
    all |= words[i];
  }
  return all;
}

extern const MaskKernel kKernel;
const MaskKernel kKernel = {RIGCAL_KERNEL_NAME, &MaskBgr, &MaskMono, &MaskBgrNoting};

}  // namespace rigcal::agent::RIGCAL_KERNEL
