// SPDX-License-Identifier: Apache-2.0
#pragma once

// Events that go through the same operations side by side, for the blink filter's kernel. Compiled
// once per instruction set into a namespace of its own (RIGCAL_KERNEL), so that no inline function
// of one set is ever linked in the place of another's.
#ifndef RIGCAL_KERNEL
#error "only the kernel's own source files include this, with RIGCAL_KERNEL defined"
#endif

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "agent/event/event.h"

#if defined(__AVX512CD__)
#include <immintrin.h>
#define RIGCAL_KERNEL_NAME "avx512"
#else
#define RIGCAL_KERNEL_NAME "portable"
#endif
#define RIGCAL_INLINE __attribute__((always_inline)) inline

namespace rigcal::agent::RIGCAL_KERNEL {

#if defined(__AVX512CD__)
constexpr size_t kLanes = 16;
constexpr size_t kGroupsAhead = 0;
#else
constexpr size_t kLanes = 4;
// Noise comes from all over the sensor: states are fetched into the cache so many groups ahead.
constexpr size_t kGroupsAhead = 16;
#endif

typedef uint32_t Lanes __attribute__((vector_size(4 * kLanes)));
typedef uint32_t LanesAnywhere __attribute__((vector_size(4 * kLanes), aligned(4), may_alias));

RIGCAL_INLINE Lanes Spread(uint32_t value) { return value - Lanes{}; }
RIGCAL_INLINE Lanes Load(const uint32_t* from) {
  return *reinterpret_cast<const LanesAnywhere*>(from);
}
RIGCAL_INLINE void Store(Lanes lanes, uint32_t* to) {
  *reinterpret_cast<LanesAnywhere*>(to) = lanes;
}

// Each instruction set has
//   Mask                          one truth value per lane, with & | ~
//   First(count)                  the first lanes
//   Any(mask)
//   HighestBit(lanes)             whether it is set
//   AtLeast(a, b)                 both below 2^31
//   Where(mask, lanes)            zero elsewhere
//   Select(mask, yes, no)
//   Min(a, b)                     both below 2^31
//   Events, LoadEvents            a group of events, times and places apart
//   Index(place, stride)          x + y * stride, of places without polarity; below 2^24
//   Gather, Scatter               every index must be valid; of equal ones the last lane is stored
//   AllDiffer(lanes)
//   FirstOfEqual(lanes, among)    those of `among` that none of `among` before them is equal to
struct Events {
  Lanes time_us;
  Lanes place;  // x, above it y, in bit 31 the polarity
};

#if defined(__AVX512CD__)

typedef __mmask16 Mask;

RIGCAL_INLINE Mask First(size_t count) { return static_cast<Mask>((1u << count) - 1); }
RIGCAL_INLINE bool Any(Mask mask) { return mask != 0; }
RIGCAL_INLINE Mask HighestBit(Lanes a) {
  return _mm512_cmplt_epi32_mask((__m512i)a, _mm512_setzero_si512());
}
RIGCAL_INLINE Mask AtLeast(Lanes a, Lanes b) {
  return _mm512_cmpge_epu32_mask((__m512i)a, (__m512i)b);
}
RIGCAL_INLINE Lanes Where(Mask mask, Lanes a) {
  return (Lanes)_mm512_maskz_mov_epi32(mask, (__m512i)a);
}
RIGCAL_INLINE Lanes Select(Mask mask, Lanes yes, Lanes no) {
  return (Lanes)_mm512_mask_mov_epi32((__m512i)no, mask, (__m512i)yes);
}
RIGCAL_INLINE Lanes Min(Lanes a, Lanes b) {
  return (Lanes)_mm512_min_epu32((__m512i)a, (__m512i)b);
}
RIGCAL_INLINE Events LoadEvents(const PackedEvent* events) {
  const __m512i even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
  const __m512i odd = _mm512_add_epi32(even, _mm512_set1_epi32(1));
  const __m512i first = _mm512_loadu_si512(events), second = _mm512_loadu_si512(events + 8);
  return {(Lanes)_mm512_permutex2var_epi32(first, even, second),
          (Lanes)_mm512_permutex2var_epi32(first, odd, second)};
}
RIGCAL_INLINE Lanes Index(Lanes place, uint32_t stride) {
  return (Lanes)_mm512_madd_epi16((__m512i)place, (__m512i)Spread(stride << 16 | 1));
}
RIGCAL_INLINE Lanes Gather(Mask mask, const uint32_t* from, Lanes index) {
  return (Lanes)_mm512_mask_i32gather_epi32(_mm512_setzero_si512(), mask, (__m512i)index, from, 4);
}
RIGCAL_INLINE void Scatter(Mask mask, Lanes lanes, uint32_t* to, Lanes index) {
  _mm512_mask_i32scatter_epi32(to, mask, (__m512i)index, (__m512i)lanes, 4);
}
RIGCAL_INLINE bool AllDiffer(Lanes a) {
  const __m512i earlier = _mm512_conflict_epi32((__m512i)a);
  return _mm512_test_epi32_mask(earlier, earlier) == 0;
}
RIGCAL_INLINE Mask FirstOfEqual(Lanes a, Mask among) {
  return _mm512_mask_testn_epi32_mask(among, _mm512_conflict_epi32((__m512i)a),
                                      (__m512i)Spread(among));
}

#else

typedef int32_t Mask __attribute__((vector_size(16)));  // 0 or -1
typedef float Floats __attribute__((vector_size(16)));

RIGCAL_INLINE Mask First(size_t count) { return Mask{0, 1, 2, 3} < static_cast<int32_t>(count); }
RIGCAL_INLINE bool Any(Mask mask) {
  uint64_t halves[2];
  std::memcpy(halves, &mask, sizeof(mask));
  return (halves[0] | halves[1]) != 0;
}
RIGCAL_INLINE Mask HighestBit(Lanes a) { return (Mask)a >> 31; }
RIGCAL_INLINE Mask AtLeast(Lanes a, Lanes b) { return (Mask)a > (Mask)(b - 1); }
RIGCAL_INLINE Lanes Where(Mask mask, Lanes a) { return (Lanes)mask & a; }
RIGCAL_INLINE Lanes Select(Mask mask, Lanes yes, Lanes no) {
  return no ^ ((no ^ yes) & (Lanes)mask);
}
RIGCAL_INLINE Lanes Min(Lanes a, Lanes b) { return Select((Mask)a < (Mask)b, a, b); }
RIGCAL_INLINE Events LoadEvents(const PackedEvent* events) {
  Lanes first, second;
  std::memcpy(&first, events, sizeof(first));
  std::memcpy(&second, events + 2, sizeof(second));
  return {__builtin_shufflevector(first, second, 0, 2, 4, 6),
          __builtin_shufflevector(first, second, 1, 3, 5, 7)};
}
// Every CPU multiplies vectors of floats; these are whole numbers below 2^24.
RIGCAL_INLINE Lanes Index(Lanes place, uint32_t stride) {
  const Floats row = __builtin_convertvector((Mask)(place >> 16), Floats);
  const Mask before = __builtin_convertvector(row * static_cast<float>(stride), Mask);
  return (Lanes)before + (place & 0xffff);
}
RIGCAL_INLINE Lanes Gather(Mask, const uint32_t* from, Lanes index) {
  return Lanes{from[index[0]], from[index[1]], from[index[2]], from[index[3]]};
}
RIGCAL_INLINE void Scatter(Mask mask, Lanes lanes, uint32_t* to, Lanes index) {
  for (size_t i = 0; i < kLanes; ++i) {
    uint32_t& at = to[index[i]];
    at ^= (at ^ lanes[i]) & static_cast<uint32_t>(mask[i]);
  }
}
RIGCAL_INLINE bool AllDiffer(Lanes a) {
  return !Any((a == __builtin_shufflevector(a, a, 1, 2, 3, 0)) |
              (a == __builtin_shufflevector(a, a, 2, 3, 0, 1)));
}
RIGCAL_INLINE Mask FirstOfEqual(Lanes a, Mask among) {
  Mask first = among;
  for (size_t i = 1; i < kLanes; ++i) {
    for (size_t k = 0; k < i; ++k) first[i] &= a[i] == a[k] ? ~among[k] : -1;
  }
  return first;
}

#endif

}  // namespace rigcal::agent::RIGCAL_KERNEL
