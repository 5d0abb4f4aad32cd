// SPDX-License-Identifier: Apache-2.0
// Only intrinsics and functions of this file: code of others compiled here could end up being used
// on a CPU without AVX-512. F, BW and CD are needed.
#include <immintrin.h>

#include "agent/detect/event/blink_kernel.h"

namespace rigcal::agent {
namespace {

constexpr size_t kLanes = 16;

__m512i Spread(uint32_t value) { return _mm512_set1_epi32(static_cast<int>(value)); }

struct Rules {
  explicit Rules(const BlinkRules& rules)
      : shift(_mm_cvtsi32_si128(rules.shift)),
        row_and_column(Spread(rules.stride << 16 | 1)),
        tile_row_and_column(Spread(rules.tile_columns << 16 | 1)),
        min_gap(Spread(rules.min_gap)),
        min_gap_again(Spread(rules.min_gap + rules.again_gap)),
        low_gap(Spread(rules.low_gap)),
        band_gap(Spread(rules.band_gap)),
        min_periods(Spread(rules.min_periods)) {}

  __m128i shift;
  __m512i row_and_column, tile_row_and_column;  // factors of x and y
  __m512i min_gap, min_gap_again, low_gap, band_gap, min_periods;
};

// Of 16 events.
struct Events {
  __m512i time_us;
  __m512i place;  // x, and y above it
  __mmask16 on;
};

Events Split(__m512i first, __m512i second) {
  const __m512i even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
  const __m512i odd = _mm512_add_epi32(even, Spread(1));
  const __m512i place = _mm512_permutex2var_epi32(first, odd, second);
  return {_mm512_permutex2var_epi32(first, even, second),
          _mm512_and_si512(place, Spread(0x7fffffff)),
          _mm512_cmplt_epi32_mask(place, _mm512_setzero_si512())};
}

// `blinks`: those that crossed and have periods enough.
__m512i NewStates(const Rules& rules, const Events& events, __m512i old, __mmask16* blinks) {
  const __m512i now = _mm512_srl_epi32(events.time_us, rules.shift);
  const __m512i gap =
      _mm512_and_si512(_mm512_sub_epi32(now, _mm512_srli_epi32(old, 16)), Spread(0xffff));
  const __mmask16 was_on = _mm512_test_epi32_mask(old, Spread(BlinkRules::kOnBit));
  const __mmask16 crosses = _mm512_mask_cmpge_epu32_mask(
      events.on, gap, _mm512_mask_mov_epi32(rules.min_gap, was_on, rules.min_gap_again));
  const __mmask16 good = _mm512_mask_cmple_epu32_mask(
      static_cast<__mmask16>(~was_on), _mm512_sub_epi32(gap, rules.low_gap), rules.band_gap);
  const __m512i kept = Spread(BlinkRules::kPeriodsMask);
  const __m512i periods =
      _mm512_maskz_min_epu32(good, _mm512_add_epi32(_mm512_and_si512(old, kept), Spread(1)), kept);
  *blinks = _mm512_mask_cmpge_epu32_mask(crosses, periods, rules.min_periods);
  const __m512i crossed = _mm512_or_si512(
      _mm512_or_si512(_mm512_slli_epi32(now, 16),
                      _mm512_slli_epi32(_mm512_min_epu32(gap, Spread(BlinkRules::kMaxGap)), 4)),
      _mm512_or_si512(periods, Spread(BlinkRules::kOnBit)));
  const __m512i off = _mm512_andnot_si512(Spread(BlinkRules::kOnBit), old);
  const __m512i stays = _mm512_mask_or_epi32(off, events.on, off, Spread(BlinkRules::kOnBit));
  return _mm512_mask_mov_epi32(stays, crosses, crossed);
}

void MarkTiles(const Rules& rules, const Events& events, __mmask16 blinks, uint32_t* tiles) {
  const __m512i tile = _mm512_and_si512(_mm512_srli_epi32(events.place, BlinkRules::kTileShift),
                                        Spread(0xffffu << 16 | 0xffffu >> BlinkRules::kTileShift));
  // Of lanes with one tile the last is stored last.
  _mm512_mask_i32scatter_epi32(tiles, blinks, _mm512_madd_epi16(tile, rules.tile_row_and_column),
                               _mm512_or_si512(events.time_us, Spread(1)), 4);
}

// Lanes of one pixel take their turns.
__mmask16 UpdateInTurns(const Rules& rules, const Events& events, __mmask16 lanes, __m512i pixel,
                        __m512i earlier, uint32_t* states) {
  __mmask16 all_blinks = 0, waiting = lanes;
  while (waiting != 0) {
    const __mmask16 ready = _mm512_mask_testn_epi32_mask(waiting, earlier, Spread(waiting));
    __mmask16 blinks;
    const __m512i old =
        _mm512_mask_i32gather_epi32(_mm512_setzero_si512(), ready, pixel, states, 4);
    const __m512i updated = NewStates(rules, events, old, &blinks);
    _mm512_mask_i32scatter_epi32(states, ready, pixel, updated, 4);
    all_blinks = static_cast<__mmask16>(all_blinks | (blinks & ready));
    waiting = static_cast<__mmask16>(waiting & ~ready);
  }
  return all_blinks;
}

void UpdateLanes(const Rules& rules, const Events& events, __mmask16 lanes, uint32_t* states,
                 uint32_t* tiles) {
  const __m512i pixel = _mm512_madd_epi16(events.place, rules.row_and_column);
  const __m512i earlier = _mm512_maskz_conflict_epi32(lanes, pixel);
  __mmask16 blinks;
  if (lanes != 0xffff || _mm512_test_epi32_mask(earlier, earlier) != 0) [[unlikely]] {
    blinks = UpdateInTurns(rules, events, lanes, pixel, earlier, states);
  } else {
    const __m512i old = _mm512_i32gather_epi32(pixel, states, 4);
    const __m512i updated = NewStates(rules, events, old, &blinks);
    _mm512_i32scatter_epi32(states, pixel, updated, 4);
  }
  if (blinks != 0) MarkTiles(rules, events, blinks, tiles);
}

void UpdateAvx512(const BlinkRules& rules_in, const PackedEvent* events, size_t count,
                  uint32_t* states, uint32_t* tiles) {
  const Rules rules(rules_in);
  size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    UpdateLanes(rules, Split(_mm512_loadu_si512(events + i), _mm512_loadu_si512(events + i + 8)),
                0xffff, states, tiles);
  }
  if (i == count) return;
  const auto left = static_cast<__mmask16>((1u << (count - i)) - 1);
  const auto first = static_cast<__mmask8>(left), second = static_cast<__mmask8>(left >> 8);
  UpdateLanes(rules,
              Split(_mm512_maskz_loadu_epi64(first, events + i),
                    _mm512_maskz_loadu_epi64(second, events + i + 8)),
              left, states, tiles);
}

void SweepAvx512(uint32_t now_units, uint32_t* states, size_t count) {
  const __m512i now = Spread(now_units << 16);
  const __m512i forgotten = Spread((now_units - BlinkRules::kForgetUnits) << 16);
  for (size_t i = 0; i < count; i += kLanes) {
    const auto lanes =
        static_cast<__mmask16>(count - i >= kLanes ? 0xffff : (1u << (count - i)) - 1);
    const __m512i old = _mm512_maskz_loadu_epi32(lanes, states + i);
    const __m512i since = _mm512_sub_epi32(now, _mm512_and_si512(old, Spread(0xffff0000)));
    const __mmask16 silent =
        _mm512_mask_cmpge_epu32_mask(lanes, since, Spread(BlinkRules::kForgetUnits << 16));
    const __m512i renewed =
        _mm512_or_si512(forgotten, _mm512_and_si512(old, Spread(BlinkRules::kOnBit)));
    _mm512_mask_storeu_epi32(states + i, lanes, _mm512_mask_mov_epi32(old, silent, renewed));
  }
}

}  // namespace

extern const BlinkKernel kAvx512BlinkKernel;
const BlinkKernel kAvx512BlinkKernel = {"avx512", &UpdateAvx512, &SweepAvx512};

}  // namespace rigcal::agent
