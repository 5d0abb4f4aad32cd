// SPDX-License-Identifier: Apache-2.0
#pragma once

// Registers of bytes that go through the same operations side by side; the mask kernel keeps one
// channel of several pixels in each. Compiled for each instruction set into a namespace of its own
// (RIGCAL_KERNEL), so that no inline function of one set is ever linked in the place of another's.
#ifndef RIGCAL_KERNEL
#error "only the kernel's own source files include this, with RIGCAL_KERNEL defined"
#endif

#include <cstdint>
#include <cstring>

#include "agent/detect/blobs/integer_colour_range.h"

#if defined(__AVX512BW__)
#include <immintrin.h>
#define RIGCAL_MM(name) _mm512_##name
#define RIGCAL_KERNEL_NAME "avx512"
#elif defined(__AVX2__)
#include <immintrin.h>
#define RIGCAL_MM(name) _mm256_##name
#define RIGCAL_KERNEL_NAME "avx2"
#else
#if defined(__SSE2__)
#include <emmintrin.h>
#endif
#define RIGCAL_KERNEL_NAME "portable"
#endif
#define RIGCAL_INLINE __attribute__((always_inline)) inline

namespace rigcal::agent::RIGCAL_KERNEL {

#if defined(__AVX512BW__)
constexpr int kWidth = 64;
typedef __m512i Register;
#elif defined(__AVX2__)
constexpr int kWidth = 32;
typedef __m256i Register;
#else
constexpr int kWidth = 16;
#endif

typedef uint8_t Bytes __attribute__((vector_size(kWidth)));
typedef uint8_t BytesAnywhere __attribute__((vector_size(kWidth), aligned(1), may_alias));
typedef int16_t Words __attribute__((vector_size(kWidth)));

// Several pixels, one register per channel.
struct Planes {
  Bytes channel[3];
};

RIGCAL_INLINE Bytes Load(const uint8_t* from) {
  return *reinterpret_cast<const BytesAnywhere*>(from);
}
RIGCAL_INLINE Bytes Spread(uint8_t level) { return level - Bytes{}; }

// Each instruction set defines
//   Mask                        one truth value per byte, with & | ~
//   ToMask(bytes)               of bytes that are 0 or 255
//   AtMost, Equal               byte by byte
//   ToBits(mask)                one bit per byte
//   AnyAbove(bytes, below)      whether one of the bytes is larger
//   Max, Min                    byte by byte
//   Low, High                   halves of each 128 bits, as words
//   PackLevels, PackTruths      the bytes that Low and High took apart: 0 to 255, or 0 and -1
//   MultiplyHigh(words, share)  words * share / 2^16, unsigned; MultiplyHighSigned: signed
//   Deinterleave(pixels)        kWidth pixels of three channels
#if defined(RIGCAL_MM)

RIGCAL_INLINE Bytes Max(Bytes a, Bytes b) {
  return (Bytes)RIGCAL_MM(max_epu8)((Register)a, (Register)b);
}
RIGCAL_INLINE Bytes Min(Bytes a, Bytes b) {
  return (Bytes)RIGCAL_MM(min_epu8)((Register)a, (Register)b);
}
RIGCAL_INLINE Words Low(Bytes a) {
  return (Words)RIGCAL_MM(unpacklo_epi8)((Register)a, Register{});
}
RIGCAL_INLINE Words High(Bytes a) {
  return (Words)RIGCAL_MM(unpackhi_epi8)((Register)a, Register{});
}
RIGCAL_INLINE Bytes PackLevels(Words low, Words high) {
  return (Bytes)RIGCAL_MM(packus_epi16)((Register)low, (Register)high);
}
RIGCAL_INLINE Bytes PackTruths(Words low, Words high) {
  return (Bytes)RIGCAL_MM(packs_epi16)((Register)low, (Register)high);
}
RIGCAL_INLINE Words MultiplyHigh(Words a, uint16_t b) {
  return (Words)RIGCAL_MM(mulhi_epu16)((Register)a, RIGCAL_MM(set1_epi16)(static_cast<short>(b)));
}
RIGCAL_INLINE Words MultiplyHighSigned(Words a, int16_t b) {
  return (Words)RIGCAL_MM(mulhi_epi16)((Register)a, RIGCAL_MM(set1_epi16)(b));
}

RIGCAL_INLINE __m128i LoadLane(const uint8_t* from) {
  return _mm_loadu_si128(reinterpret_cast<const __m128i*>(from));
}

#if defined(__AVX512BW__)
typedef uint64_t Mask;
RIGCAL_INLINE Mask ToMask(Bytes a) { return _mm512_movepi8_mask((Register)a); }
RIGCAL_INLINE Mask AtMost(Bytes a, Bytes b) {
  return _mm512_cmple_epu8_mask((Register)a, (Register)b);
}
RIGCAL_INLINE Mask Equal(Bytes a, Bytes b) {
  return _mm512_cmpeq_epi8_mask((Register)a, (Register)b);
}
RIGCAL_INLINE uint64_t ToBits(Mask mask) { return mask; }
RIGCAL_INLINE bool AnyAbove(Bytes a, Bytes below) {
  return _mm512_cmpgt_epu8_mask((Register)a, (Register)below) != 0;
}
// Loads 16 bytes from each group of 16 pixels (48 bytes).
RIGCAL_INLINE Register LoadLanes(const uint8_t* from) {
  const Register one =
      _mm512_inserti32x4(_mm512_castsi128_si512(LoadLane(from)), LoadLane(from + 48), 1);
  return _mm512_inserti32x4(_mm512_inserti32x4(one, LoadLane(from + 96), 2), LoadLane(from + 144),
                            3);
}
// Takes `b` at the places of each 16 bytes whose number modulo 3 is `remainder`, else `a`.
template <uint8_t remainder>
RIGCAL_INLINE Register BlendThird(Register a, Register b) {
  constexpr uint64_t kLane = 0x9249 << remainder & 0xffff;
  return _mm512_mask_blend_epi8(kLane | kLane << 16 | kLane << 32 | kLane << 48, a, b);
}
RIGCAL_INLINE Bytes Order(Register a, __m128i order) {
  return (Bytes)_mm512_shuffle_epi8(a, _mm512_broadcast_i32x4(order));
}
#else
typedef Bytes Mask;
RIGCAL_INLINE Mask ToMask(Bytes a) { return a; }
RIGCAL_INLINE Mask AtMost(Bytes a, Bytes b) {
  return (Bytes)_mm256_subs_epu8((Register)a, (Register)b) == 0;
}
RIGCAL_INLINE Mask Equal(Bytes a, Bytes b) { return (Mask)(a == b); }
RIGCAL_INLINE uint64_t ToBits(Mask mask) {
  return static_cast<uint32_t>(_mm256_movemask_epi8((Register)mask));
}
RIGCAL_INLINE bool AnyAbove(Bytes a, Bytes below) {
  const Register above = _mm256_subs_epu8((Register)a, (Register)below);
  return _mm256_testz_si256(above, above) == 0;
}
RIGCAL_INLINE Register LoadLanes(const uint8_t* from) {
  return _mm256_inserti128_si256(_mm256_castsi128_si256(LoadLane(from)), LoadLane(from + 48), 1);
}
template <uint8_t remainder>
RIGCAL_INLINE Register BlendThird(Register a, Register b) {
  const Bytes places = {0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0,
                        0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0};
  return _mm256_blendv_epi8(a, b, (Register)(places == Spread(remainder)));
}
RIGCAL_INLINE Bytes Order(Register a, __m128i order) {
  return (Bytes)_mm256_shuffle_epi8(a, _mm256_broadcastsi128_si256(order));
}
#endif

// In 48 bytes (16 pixels) the bytes of one channel lie at different places of the three vectors, so
// blending brings them together and one shuffle sorts them.
RIGCAL_INLINE Planes Deinterleave(const uint8_t* pixels) {
  const Register a = LoadLanes(pixels), b = LoadLanes(pixels + 16), c = LoadLanes(pixels + 32);
  Planes planes;
  planes.channel[kBlue] =
      Order(BlendThird<1>(BlendThird<2>(a, b), c),
            _mm_setr_epi8(0, 3, 6, 9, 12, 15, 2, 5, 8, 11, 14, 1, 4, 7, 10, 13));
  planes.channel[kGreen] =
      Order(BlendThird<2>(BlendThird<1>(b, a), c),
            _mm_setr_epi8(1, 4, 7, 10, 13, 0, 3, 6, 9, 12, 15, 2, 5, 8, 11, 14));
  planes.channel[kRed] = Order(BlendThird<2>(BlendThird<1>(c, b), a),
                               _mm_setr_epi8(2, 5, 8, 11, 14, 1, 4, 7, 10, 13, 0, 3, 6, 9, 12, 15));
  return planes;
}

#else

typedef Bytes Mask;
RIGCAL_INLINE Mask ToMask(Bytes a) { return a; }
RIGCAL_INLINE Mask AtMost(Bytes a, Bytes b) { return (Mask)(a <= b); }
RIGCAL_INLINE Mask Equal(Bytes a, Bytes b) { return (Mask)(a == b); }
RIGCAL_INLINE uint64_t ToBits(Mask mask) {
#if defined(__SSE2__)
  return static_cast<uint32_t>(_mm_movemask_epi8((__m128i)mask));
#else
  uint64_t halves[2];
  const Bytes ones = mask & 1;
  std::memcpy(halves, &ones, sizeof(ones));
  constexpr uint64_t kGather = 0x0102040810204080;  // gathers eight bytes of 0 or 1 in the highest
  return halves[0] * kGather >> 56 | halves[1] * kGather >> 56 << 8;
#endif
}
RIGCAL_INLINE bool AnyAbove(Bytes a, Bytes below) {
  uint64_t halves[2];
  const Bytes above = (Bytes)(a > below);
  std::memcpy(halves, &above, sizeof(above));
  return (halves[0] | halves[1]) != 0;
}
RIGCAL_INLINE Bytes Max(Bytes a, Bytes b) { return a > b ? a : b; }
RIGCAL_INLINE Bytes Min(Bytes a, Bytes b) { return a < b ? a : b; }
RIGCAL_INLINE Words Low(Bytes a) {
  return (Words)__builtin_shufflevector(a, Bytes{}, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22,
                                        7, 23);
}
RIGCAL_INLINE Words High(Bytes a) {
  return (Words)__builtin_shufflevector(a, Bytes{}, 8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29,
                                        14, 30, 15, 31);
}
RIGCAL_INLINE Bytes PackLevels(Words low, Words high) {
  return __builtin_shufflevector((Bytes)low, (Bytes)high, 0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22,
                                 24, 26, 28, 30);
}
RIGCAL_INLINE Bytes PackTruths(Words low, Words high) { return PackLevels(low, high); }
RIGCAL_INLINE Words MultiplyHigh(Words a, uint16_t b) {
#if defined(__SSE2__)  // gcc does not find it for a loop of eight
  return (Words)_mm_mulhi_epu16((__m128i)a, _mm_set1_epi16(static_cast<int16_t>(b)));
#else
  Words high;
  for (int i = 0; i < 8; ++i) {
    high[i] = static_cast<int16_t>(static_cast<uint16_t>(a[i]) * uint32_t{b} >> 16);
  }
  return high;
#endif
}
RIGCAL_INLINE Words MultiplyHighSigned(Words a, int16_t b) {
#if defined(__SSE2__)
  return (Words)_mm_mulhi_epi16((__m128i)a, _mm_set1_epi16(b));
#else
  Words high;
  for (int i = 0; i < 8; ++i) high[i] = static_cast<int16_t>(a[i] * b >> 16);
  return high;
#endif
}

// Each round moves byte i of the 48 to place 2 i modulo 47. After four rounds it is at 16 i modulo
// 47, which is its place in the plane of its channel.
RIGCAL_INLINE Planes Deinterleave(const uint8_t* pixels) {
  Bytes a = Load(pixels), b = Load(pixels + 16), c = Load(pixels + 32);
  for (int round = 0; round < 4; ++round) {
    // Interleaves the low half of one with the high half of the other.
    const Bytes first =
        __builtin_shufflevector(a, b, 0, 24, 1, 25, 2, 26, 3, 27, 4, 28, 5, 29, 6, 30, 7, 31);
    const Bytes second =
        __builtin_shufflevector(a, c, 8, 16, 9, 17, 10, 18, 11, 19, 12, 20, 13, 21, 14, 22, 15, 23);
    c = __builtin_shufflevector(b, c, 0, 24, 1, 25, 2, 26, 3, 27, 4, 28, 5, 29, 6, 30, 7, 31);
    a = first;
    b = second;
  }
  Planes planes;
  planes.channel[kBlue] = a;
  planes.channel[kGreen] = b;
  planes.channel[kRed] = c;
  return planes;
}

#endif

}  // namespace rigcal::agent::RIGCAL_KERNEL
