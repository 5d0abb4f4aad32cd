// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <immintrin.h>

#include <cstddef>
#include <cstdint>

#include "agent/detect/blobs/integer_colour_range.h"

namespace rigcal::agent {

// What the kernels of x86's vectors share: the walk along a row and the test of a hue. `Vector` is
// a struct of the kernel's file, in its unnamed namespace, so that every instantiation is that
// file's own: none that is compiled for one CPU is ever used on another. It has
//   Register                           a vector of bytes
//   Spread(level)                      the level in every byte
//   Low(bytes), High(bytes)            the bytes of either half of each 128 bits, as 16-bit numbers
//   Spread16, Subtract16, MultiplyHigh16, Greater16     16-bit numbers, signed
//   Pack(low, high)                    bytes of what Low and High took apart; true is all bits
//   AnyAbove(pixels, below)            whether one of 3 * 64 bytes is larger
//   BitsAbove(pixels, below)           which of 64 bytes are larger
//   MaskBlock(range, pixels)           the word of 64 BGR pixels, of which some channel is bright
template <typename Vector>
struct MaskRows {
  using Register = typename Vector::Register;

  static constexpr int kBlock = 64;  // pixels of a word
  static constexpr int kCacheLine = 64;

  struct Planes {
    Register channel[3];
  };

  static Register InHalfPlane16(Register plus, Register minus, Register slope_plus,
                                Register slope_minus, Register slope) {
    const Register run = Vector::Subtract16(slope_plus, slope_minus);
    return Vector::Greater16(Vector::Subtract16(plus, minus), Vector::MultiplyHigh16(run, slope));
  }

  // All bits of the bytes whose pixel is inside.
  static Register InHalfPlane(const HueHalfPlane& plane, const Planes& planes) {
    const Register plus = planes.channel[plane.plus];
    const Register minus = planes.channel[plane.minus];
    const Register slope_plus = planes.channel[plane.slope_plus];
    const Register slope_minus = planes.channel[plane.slope_minus];
    const Register slope = Vector::Spread16(plane.slope);
    return Vector::Pack(InHalfPlane16(Vector::Low(plus), Vector::Low(minus),
                                      Vector::Low(slope_plus), Vector::Low(slope_minus), slope),
                        InHalfPlane16(Vector::High(plus), Vector::High(minus),
                                      Vector::High(slope_plus), Vector::High(slope_minus), slope));
  }

  // The lines that lie `ahead` bytes after `count` bytes, where no object need be.
  static void Prefetch(const uint8_t* bytes, ptrdiff_t ahead, int count) {
    const uintptr_t first = reinterpret_cast<uintptr_t>(bytes) + static_cast<uintptr_t>(ahead);
    for (int i = 0; i < count; i += kCacheLine) {
      const uintptr_t address = first + static_cast<uintptr_t>(i);
      _mm_prefetch(reinterpret_cast<const char*>(address), _MM_HINT_T0);
    }
  }

  // MaskKernel::bgr. A word's pixels are first asked together, channels mixed, whether any is
  // bright enough.
  static uint64_t Bgr(const IntegerColourRange& range, const uint8_t* pixels, ptrdiff_t next_row,
                      int word_count, uint64_t* words) {
    const Register below = Vector::Spread(range.value_below);
    uint64_t all = 0;
    for (int i = 0; i < word_count; ++i, pixels += 3 * kBlock) {
      Prefetch(pixels, next_row, 3 * kBlock);
      words[i] = Vector::AnyAbove(pixels, below) ? Vector::MaskBlock(range, pixels) : 0;
      all |= words[i];
    }
    return all;
  }

  // MaskKernel::mono.
  static uint64_t Mono(const IntegerColourRange& range, const uint8_t* pixels, ptrdiff_t next_row,
                       int word_count, uint64_t* words) {
    const Register below = Vector::Spread(range.value_below);
    uint64_t all = 0;
    for (int i = 0; i < word_count; ++i, pixels += kBlock) {
      Prefetch(pixels, next_row, kBlock);
      words[i] = Vector::BitsAbove(pixels, below);
      all |= words[i];
    }
    return all;
  }
};

}  // namespace rigcal::agent
