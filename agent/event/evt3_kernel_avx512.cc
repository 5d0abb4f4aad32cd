// SPDX-License-Identifier: Apache-2.0
// Only intrinsics and functions of this file: code of others compiled here could end up being used
// on a CPU without AVX-512. F, BW, VL and CD are needed.
#include <immintrin.h>

#include "agent/event/evt3_kernel.h"

namespace rigcal::agent {
namespace {

constexpr int kLanes = 16;
static_assert(kLanes == Evt3Kernel::kBlockWords);

__m512i Spread(uint32_t value) { return _mm512_set1_epi32(static_cast<int>(value)); }

// Each lane takes from `words` what the last lane of `set` up to it holds, or the last lane of
// `before` if there is none.
__m512i FillForward(__mmask16 set, __m512i words, __m512i before) {
  const __m512i up_to = _mm512_setr_epi32(0x1, 0x3, 0x7, 0xf, 0x1f, 0x3f, 0x7f, 0xff, 0x1ff, 0x3ff,
                                          0x7ff, 0xfff, 0x1fff, 0x3fff, 0x7fff, 0xffff);
  // Bit 15 to 0 is lane 15 to 0 of `words`; no bit gives 63, lane 15 of `before`.
  const __m512i lane = _mm512_xor_si512(
      _mm512_lzcnt_epi32(_mm512_and_si512(_mm512_broadcastmw_epi32(set), up_to)), Spread(31));
  return _mm512_permutex2var_epi32(words, lane, before);
}

// Sums of this lane and all before it.
__m512i SumForward(__m512i values) {
  const __m512i zero = _mm512_setzero_si512();
  values = _mm512_add_epi32(values, _mm512_alignr_epi32(values, zero, kLanes - 1));
  values = _mm512_add_epi32(values, _mm512_alignr_epi32(values, zero, kLanes - 2));
  values = _mm512_add_epi32(values, _mm512_alignr_epi32(values, zero, kLanes - 4));
  return _mm512_add_epi32(values, _mm512_alignr_epi32(values, zero, kLanes - 8));
}

uint32_t LastLane(__m512i values) {
  return static_cast<uint32_t>(_mm_extract_epi32(_mm512_extracti32x4_epi32(values, 3), 3));
}

void Store(__m512i events, PackedEvent* to) { _mm512_storeu_si512(to, events); }

// Halves of 16 events to whole ones.
struct Events {
  __m512i low, high;
};
Events Join(__m512i time_us, __m512i place) {
  const __m512i low = _mm512_setr_epi32(0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
  const __m512i high = _mm512_add_epi32(low, Spread(8));
  return {_mm512_permutex2var_epi32(time_us, low, place),
          _mm512_permutex2var_epi32(time_us, high, place)};
}

// A block's words, and those of them that each type has.
struct Block {
  __m512i words, types;
  __mmask16 rows, columns, times;

  __mmask16 Are(uint32_t type) const { return _mm512_cmpeq_epi32_mask(types, Spread(type)); }
};

// What the words before a block leave to it is in the last lane.
struct Held {
  __m512i row, time, base;
};

struct Vectors {
  __mmask16 set;
  __m512i base;       // of the words that are vectors: column * 2 + polarity
  __m512i base_next;  // behind each word
  bool good;
};

Vectors TakeVectors(const Block& block, const Evt3State& limits, __m512i base_before) {
  const __mmask16 twelve = block.Are(0x4), eight = block.Are(0x5), bases = block.Are(0x3);
  Vectors vectors;
  vectors.set = static_cast<__mmask16>(twelve | eight);
  const __mmask16 idle =
      static_cast<__mmask16>(block.Are(0x7) | block.Are(0xE) | block.Are(0xF) |
                             _mm512_cmpeq_epi32_mask(block.words, Spread(limits.known_high)));
  const uint32_t known =
      static_cast<uint32_t>(block.rows) | block.columns | block.times | vectors.set | bases | idle;
  const __m512i length =
      _mm512_mask_mov_epi32(_mm512_maskz_mov_epi32(twelve, Spread(24)), eight, Spread(16));
  const __m512i behind = SumForward(length);
  const __m512i here = _mm512_sub_epi32(behind, length);
  // Relative to the lengths before it a base holds as a row does.
  const __m512i told =
      _mm512_or_si512(_mm512_and_si512(_mm512_slli_epi32(block.words, 1), Spread(0xffe)),
                      _mm512_and_si512(_mm512_srli_epi32(block.words, 11), Spread(1)));
  const __m512i origin = FillForward(bases, _mm512_sub_epi32(told, here), base_before);
  vectors.base = _mm512_add_epi32(origin, here);
  vectors.base_next = _mm512_add_epi32(origin, behind);
  const __mmask16 outside = _mm512_mask_cmpgt_epu32_mask(
      vectors.set, _mm512_srli_epi32(vectors.base_next, 1), Spread(limits.width));
  vectors.good = known == 0xffff && outside == 0;
  return vectors;
}

// One event, or those of a vector, from each word of `set`.
PackedEvent* SpreadEvents(__mmask16 set, __m512i time_us, __m512i place, __m512i pixels,
                          PackedEvent* to) {
  alignas(64) uint64_t first[kLanes];
  alignas(64) uint32_t mask[kLanes];
  const Events events =
      Join(_mm512_maskz_compress_epi32(set, time_us), _mm512_maskz_compress_epi32(set, place));
  _mm512_store_si512(first, events.low);
  _mm512_store_si512(first + 8, events.high);
  _mm512_store_si512(mask, _mm512_maskz_compress_epi32(set, pixels));
  const __m512i steps = _mm512_slli_epi64(_mm512_setr_epi64(0, 1, 2, 3, 4, 5, 6, 7), 32);
  const __m256i far_steps = _mm256_slli_epi64(_mm256_setr_epi64x(8, 9, 10, 11), 32);
  const auto spread = [&](int i) {
    const auto event = static_cast<long long>(first[i]);
    const uint32_t near = mask[i] & 0xff, far = mask[i] >> 8;
    Store(_mm512_add_epi64(_mm512_set1_epi64(event),
                           _mm512_maskz_compress_epi64(static_cast<__mmask8>(near), steps)),
          to);
    to += __builtin_popcount(near);
    _mm256_storeu_si256(
        reinterpret_cast<__m256i*>(to),
        _mm256_add_epi64(_mm256_set1_epi64x(event),
                         _mm256_maskz_compress_epi64(static_cast<__mmask8>(far), far_steps)));
    to += __builtin_popcount(far);
  };
  // Behind the last word of `set` the masks are empty. To stop there would be mispredicted.
  for (int i = 0; i < kLanes / 2; ++i) spread(i);
  if (__builtin_popcount(set) > kLanes / 2) {
    for (int i = kLanes / 2; i < kLanes; ++i) spread(i);
  }
  return to;
}

// Row and polarity of the halves that places stand in.
__m512i PlaceOf(__m512i column, __m512i row, __m512i polarity) {
  return _mm512_or_si512(_mm512_or_si512(column, _mm512_slli_epi32(row, 16)), polarity);
}

Evt3Kernel::Position DecodeAvx512(Evt3Kernel::Position from, const uint8_t* end,
                                  const PackedEvent* full, Evt3State* state) {
  const Evt3State limits = *state;
  const __m512i width = Spread(limits.width), height = Spread(limits.height);
  const __m512i high_us = Spread(limits.high_us), known_high = Spread(limits.known_high);
  Held held{Spread(limits.y), Spread(limits.time_low), Spread(limits.base)};
  const uint8_t* at = from.at;
  PackedEvent* to = from.to;
  for (; end - at >= 2 * kLanes && to < full; at += 2 * kLanes) {
    Block block;
    block.words = _mm512_cvtepu16_epi32(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(at)));
    block.types = _mm512_srli_epi32(block.words, 12);
    block.rows = _mm512_testn_epi32_mask(block.types, block.types);
    block.columns = block.Are(0x2);
    block.times = block.Are(0x6);
    const __m512i column = _mm512_and_si512(block.words, Spread(0x7ff));
    const uint32_t outside =
        static_cast<uint32_t>(_mm512_mask_cmpge_epu32_mask(block.columns, column, width) |
                              _mm512_mask_cmpge_epu32_mask(block.rows, column, height));
    const uint32_t plain = static_cast<uint32_t>(block.rows | block.columns | block.times |
                                                 _mm512_cmpeq_epi32_mask(block.words, known_high));
    if (outside != 0) break;
    const __m512i row = FillForward(block.rows, column, held.row);
    const __m512i time =
        FillForward(block.times, _mm512_and_si512(block.words, Spread(0xfff)), held.time);
    const __m512i time_us = _mm512_add_epi32(time, high_us);
    const __m512i polarity = _mm512_slli_epi32(_mm512_and_si512(block.words, Spread(0x800)), 20);
    const __m512i place = PlaceOf(column, row, polarity);
    if (plain == 0xffff) {
      const Events events = Join(_mm512_maskz_compress_epi32(block.columns, time_us),
                                 _mm512_maskz_compress_epi32(block.columns, place));
      Store(events.low, to);
      Store(events.high, to + 8);
      to += __builtin_popcount(block.columns);
    } else {
      const Vectors vectors = TakeVectors(block, limits, held.base);
      if (!vectors.good) break;
      const __m512i base = _mm512_srli_epi32(vectors.base, 1);
      const __m512i vector_place = PlaceOf(base, row, _mm512_slli_epi32(vectors.base, 31));
      const __m512i bits =
          _mm512_mask_and_epi32(_mm512_maskz_and_epi32(vectors.set, block.words, Spread(0xfff)),
                                block.Are(0x5), block.words, Spread(0xff));
      to = SpreadEvents(static_cast<__mmask16>(block.columns | vectors.set), time_us,
                        _mm512_mask_mov_epi32(place, vectors.set, vector_place),
                        _mm512_mask_mov_epi32(bits, block.columns, Spread(1)), to);
      held.base = vectors.base_next;
    }
    held.row = row;
    held.time = time;
  }
  state->y = LastLane(held.row);
  state->time_low = LastLane(held.time);
  state->base = LastLane(held.base);
  return {at, to};
}

}  // namespace

extern const Evt3Kernel kAvx512Evt3Kernel;
const Evt3Kernel kAvx512Evt3Kernel = {"avx512", &DecodeAvx512};

}  // namespace rigcal::agent
