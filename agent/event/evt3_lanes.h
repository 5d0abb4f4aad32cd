// SPDX-License-Identifier: Apache-2.0
#pragma once

// Words of EVT 3.0 that go through the same operations side by side, for the decoder's kernel.
// Compiled once per instruction set into a namespace of its own (RIGCAL_KERNEL), so that no inline
// function of one set is ever linked in the place of another's.
#ifndef RIGCAL_KERNEL
#error "only the kernel's own source files include this, with RIGCAL_KERNEL defined"
#endif

#include <immintrin.h>

#include <cstdint>

#include "agent/event/event.h"

#define RIGCAL_INLINE __attribute__((always_inline)) inline

namespace rigcal::agent::RIGCAL_KERNEL {

// Each instruction set has
//   kLanes                       words of a block
//   Words                        a vector of them, at least 16 bits each
//   Mask                         one truth value per word, with & |
//   Not, Any, Equal, Greater     below 2^15
//   Where(mask, words)           zero elsewhere
//   Select(mask, yes, no)
//   Sets, SetsOf(a, b)           two masks as sets, one bit per word
//   LoadWords
//   SumForward(words)            of each word and all before it
//   Hold(words)                  what FillForward takes from here for the next block
//   FillForward(set, words, held)   each takes the last one of `set` up to it, or `held`
//   LastOf(held)
//   StorePixels, StoreEvents     those of `set`, one behind the other; more may be written to
//   StoreRun(event, pixels, to)  events of up to 12 pixels from that of `event` on; returns the end

// Of each word, as it stands in an event.
template <typename Words>
struct PlacesOf {
  Words time_low, column, row_polarity;
};

#if defined(__AVX512CD__)
#define RIGCAL_KERNEL_NAME "avx512"

constexpr int kLanes = 16;
typedef uint32_t Words __attribute__((vector_size(64)));
typedef uint32_t Pixels;
typedef __mmask16 Mask;
struct Sets {
  Mask first, second;
};

RIGCAL_INLINE Words Spread(uint32_t value) { return value - Words{}; }
RIGCAL_INLINE Words LoadWords(const uint8_t* from) {
  return (Words)_mm512_cvtepu16_epi32(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(from)));
}
RIGCAL_INLINE Mask Not(Mask mask) { return static_cast<Mask>(~mask); }
RIGCAL_INLINE bool Any(Mask mask) { return mask != 0; }
RIGCAL_INLINE Mask Equal(Words a, Words b) {
  return _mm512_cmpeq_epi32_mask((__m512i)a, (__m512i)b);
}
RIGCAL_INLINE Mask Greater(Words a, Words b) {
  return _mm512_cmpgt_epu32_mask((__m512i)a, (__m512i)b);
}
RIGCAL_INLINE Words Where(Mask mask, Words a) {
  return (Words)_mm512_maskz_mov_epi32(mask, (__m512i)a);
}
RIGCAL_INLINE Words Select(Mask mask, Words yes, Words no) {
  return (Words)_mm512_mask_mov_epi32((__m512i)no, mask, (__m512i)yes);
}
RIGCAL_INLINE Sets SetsOf(Mask a, Mask b) { return {a, b}; }

// So many lanes on, with zero behind.
template <int lanes>
RIGCAL_INLINE Words Shift(Words words) {
  return (Words)_mm512_alignr_epi32((__m512i)words, _mm512_setzero_si512(), kLanes - lanes);
}
RIGCAL_INLINE Words SumForward(Words words) {
  words += Shift<1>(words);
  words += Shift<2>(words);
  words += Shift<4>(words);
  return words + Shift<8>(words);
}

RIGCAL_INLINE Words Hold(Words words) { return words; }
RIGCAL_INLINE uint32_t LastOf(Words held) { return held[kLanes - 1]; }
RIGCAL_INLINE Words FillForward(Mask set, Words words, Words held) {
  const Words up_to = {0x1,   0x3,   0x7,   0xf,   0x1f,   0x3f,   0x7f,   0xff,
                       0x1ff, 0x3ff, 0x7ff, 0xfff, 0x1fff, 0x3fff, 0x7fff, 0xffff};
  // Bit 15 to 0 is lane 15 to 0 of `words`; no bit gives 63, lane 15 of `held`.
  const Words lane =
      (Words)_mm512_lzcnt_epi32((__m512i)((Words)_mm512_broadcastmw_epi32(set) & up_to)) ^ 31;
  return (Words)_mm512_permutex2var_epi32((__m512i)words, (__m512i)lane, (__m512i)held);
}

RIGCAL_INLINE void StorePixels(Words pixels, Mask set, uint32_t* to) {
  _mm512_store_si512(to, _mm512_maskz_compress_epi32(set, (__m512i)pixels));
}
RIGCAL_INLINE void StoreEvents(const PlacesOf<Words>& places, uint32_t high_us, Mask set,
                               void* to) {
  const __m512i time_us =
      _mm512_maskz_compress_epi32(set, (__m512i)(places.time_low + Spread(high_us)));
  const __m512i place =
      _mm512_maskz_compress_epi32(set, (__m512i)(places.column | places.row_polarity << 16));
  const __m512i low = _mm512_setr_epi32(0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
  const __m512i high = _mm512_add_epi32(low, (__m512i)Spread(8));
  _mm512_storeu_si512(to, _mm512_permutex2var_epi32(time_us, low, place));
  _mm512_storeu_si512(static_cast<uint64_t*>(to) + 8,
                      _mm512_permutex2var_epi32(time_us, high, place));
}
RIGCAL_INLINE PackedEvent* StoreRun(uint64_t event, uint32_t pixels, PackedEvent* to) {
  const __m512i steps = _mm512_slli_epi64(_mm512_setr_epi64(0, 1, 2, 3, 4, 5, 6, 7), 32);
  const __m256i far_steps = _mm256_slli_epi64(_mm256_setr_epi64x(8, 9, 10, 11), 32);
  const uint32_t near = pixels & 0xff, far = pixels >> 8;
  const auto first = static_cast<long long>(event);
  _mm512_storeu_si512(
      to, _mm512_add_epi64(_mm512_set1_epi64(first),
                           _mm512_maskz_compress_epi64(static_cast<__mmask8>(near), steps)));
  to += __builtin_popcount(near);
  _mm256_storeu_si256(
      reinterpret_cast<__m256i*>(to),
      _mm256_add_epi64(_mm256_set1_epi64x(first),
                       _mm256_maskz_compress_epi64(static_cast<__mmask8>(far), far_steps)));
  return to + __builtin_popcount(far);
}

#else
#define RIGCAL_KERNEL_NAME "avx2"

constexpr int kLanes = 8;
typedef uint16_t Words __attribute__((vector_size(16)));
typedef uint16_t Pixels;
typedef int16_t Mask __attribute__((vector_size(16)));  // 0 or -1
struct Sets {
  uint32_t first, second;
};

// For each set of eight lanes, byte indices for _mm_shuffle_epi8.
struct LaneTable {
  alignas(16) uint8_t bytes[256][2 * kLanes];
};
constexpr uint8_t kNone = 0x80;

// Each lane takes the last one of the set up to it; kNone where there is none.
constexpr LaneTable MakeFillTable() {
  LaneTable table{};
  for (int set = 0; set < 256; ++set) {
    int last = -1;
    for (int lane = 0; lane < kLanes; ++lane) {
      if ((set >> lane & 1) != 0) last = lane;
      for (int byte = 0; byte < 2; ++byte) {
        table.bytes[set][2 * lane + byte] =
            last < 0 ? kNone : static_cast<uint8_t>(2 * last + byte);
      }
    }
  }
  return table;
}

// The lanes of the set come first.
constexpr LaneTable MakeCompressTable() {
  LaneTable table{};
  for (int set = 0; set < 256; ++set) {
    int next = 0;
    for (int lane = 0; lane < kLanes; ++lane) {
      if ((set >> lane & 1) == 0) continue;
      for (int byte = 0; byte < 2; ++byte) {
        table.bytes[set][2 * next + byte] = static_cast<uint8_t>(2 * lane + byte);
      }
      ++next;
    }
    for (int byte = 2 * next; byte < 2 * kLanes; ++byte) table.bytes[set][byte] = kNone;
  }
  return table;
}

// For each set of four pixels, their columns as what is added to events.
struct StepTable {
  alignas(32) uint64_t steps[16][4];
};
constexpr StepTable MakeStepTable() {
  StepTable table{};
  for (int set = 0; set < 16; ++set) {
    int next = 0;
    for (uint64_t k = 0; k < 4; ++k) {
      if ((set >> k & 1) != 0) table.steps[set][next++] = k << 32;
    }
  }
  return table;
}

constexpr LaneTable kFill = MakeFillTable();
constexpr LaneTable kCompress = MakeCompressTable();
constexpr StepTable kSteps = MakeStepTable();

RIGCAL_INLINE Words Spread(uint32_t value) {
  return (Words)_mm_set1_epi16(static_cast<int16_t>(value));
}
RIGCAL_INLINE Words LoadWords(const uint8_t* from) {
  return (Words)_mm_loadu_si128(reinterpret_cast<const __m128i*>(from));
}
RIGCAL_INLINE Mask Not(Mask mask) { return mask == 0; }
RIGCAL_INLINE bool Any(Mask mask) { return _mm_testz_si128((__m128i)mask, (__m128i)mask) == 0; }
RIGCAL_INLINE Mask Equal(Words a, Words b) { return (Mask)(a == b); }
RIGCAL_INLINE Mask Greater(Words a, Words b) { return (Mask)a > (Mask)b; }
RIGCAL_INLINE Words Where(Mask mask, Words a) { return (Words)mask & a; }
RIGCAL_INLINE Words Select(Mask mask, Words yes, Words no) {
  return (Words)_mm_blendv_epi8((__m128i)no, (__m128i)yes, (__m128i)mask);
}
RIGCAL_INLINE Sets SetsOf(Mask a, Mask b) {
  const auto bits =
      static_cast<uint32_t>(_mm_movemask_epi8(_mm_packs_epi16((__m128i)a, (__m128i)b)));
  return {bits & 0xff, bits >> 8};
}

RIGCAL_INLINE Words SumForward(Words words) {
  words += (Words)_mm_slli_si128((__m128i)words, 2);
  words += (Words)_mm_slli_si128((__m128i)words, 4);
  return words + (Words)_mm_slli_si128((__m128i)words, 8);
}

RIGCAL_INLINE __m128i Row(const LaneTable& table, uint32_t set) {
  return _mm_load_si128(reinterpret_cast<const __m128i*>(table.bytes[set]));
}
RIGCAL_INLINE __m128i Compress(uint32_t set, Words words) {
  return _mm_shuffle_epi8((__m128i)words, Row(kCompress, set));
}

// The last one in every lane.
RIGCAL_INLINE Words Hold(Words words) {
  return (Words)_mm_shuffle_epi8((__m128i)words, _mm_set1_epi16(0x0f0e));
}
RIGCAL_INLINE uint32_t LastOf(Words held) { return held[0]; }
RIGCAL_INLINE Words FillForward(uint32_t set, Words words, Words held) {
  const __m128i lanes = Row(kFill, set);
  return (Words)_mm_blendv_epi8(_mm_shuffle_epi8((__m128i)words, lanes), (__m128i)held, lanes);
}

RIGCAL_INLINE void StorePixels(Words pixels, uint32_t set, uint16_t* to) {
  _mm_store_si128(reinterpret_cast<__m128i*>(to), Compress(set, pixels));
}
RIGCAL_INLINE void Store(__m256i events, void* to) {
  _mm256_storeu_si256(static_cast<__m256i*>(to), events);
}
RIGCAL_INLINE void StoreEvents(const PlacesOf<Words>& places, uint32_t high_us, uint32_t set,
                               void* to) {
  const __m256i time_us = _mm256_add_epi32(_mm256_cvtepu16_epi32(Compress(set, places.time_low)),
                                           _mm256_set1_epi32(static_cast<int>(high_us)));
  const __m128i column = Compress(set, places.column), row = Compress(set, places.row_polarity);
  const __m256i place = _mm256_inserti128_si256(
      _mm256_castsi128_si256(_mm_unpacklo_epi16(column, row)), _mm_unpackhi_epi16(column, row), 1);
  const __m256i outer = _mm256_unpacklo_epi32(time_us, place);
  const __m256i inner = _mm256_unpackhi_epi32(time_us, place);
  Store(_mm256_permute2x128_si256(outer, inner, 0x20), to);
  Store(_mm256_permute2x128_si256(outer, inner, 0x31), static_cast<uint64_t*>(to) + 4);
}
RIGCAL_INLINE PackedEvent* StoreRun(uint64_t event, uint32_t pixels, PackedEvent* to) {
  __m256i events = _mm256_set1_epi64x(static_cast<long long>(event));
  for (int part = 0; part < 3; ++part) {
    const auto* const steps = reinterpret_cast<const __m256i*>(kSteps.steps[pixels & 0xf]);
    Store(_mm256_add_epi64(events, _mm256_load_si256(steps)), to);
    to += __builtin_popcount(pixels & 0xf);
    events = _mm256_add_epi64(events, _mm256_set1_epi64x(int64_t{4} << 32));
    pixels >>= 4;
  }
  return to;
}

#endif

typedef PlacesOf<Words> Places;

}  // namespace rigcal::agent::RIGCAL_KERNEL
