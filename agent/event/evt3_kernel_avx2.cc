// SPDX-License-Identifier: Apache-2.0
// Only intrinsics and functions of this file: code of others compiled here could end up being used
// on a CPU without AVX2. Besides it POPCNT is needed.
#include <immintrin.h>

#include "agent/event/evt3_kernel.h"

namespace rigcal::agent {
namespace {

constexpr int kLanes = 8;  // words of a step
constexpr uint8_t kNone = 0x80;

// For each set of eight lanes, byte indices for _mm_shuffle_epi8.
struct LaneTable {
  alignas(16) uint8_t bytes[256][2 * kLanes];
};

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

__m128i Spread(uint32_t value) { return _mm_set1_epi16(static_cast<int16_t>(value)); }
__m128i Row(const LaneTable& table, uint32_t set) {
  return _mm_load_si128(reinterpret_cast<const __m128i*>(table.bytes[set]));
}

// Each lane takes from `words` what the last lane of `set` up to it holds, or `before`, the same in
// every lane, if there is none.
__m128i FillForward(uint32_t set, __m128i words, __m128i before) {
  const __m128i lanes = Row(kFill, set);
  return _mm_blendv_epi8(_mm_shuffle_epi8(words, lanes), before, lanes);
}

__m128i SpreadLast(__m128i words) { return _mm_shuffle_epi8(words, _mm_set1_epi16(0x0f0e)); }

__m128i SumForward(__m128i values) {
  values = _mm_add_epi16(values, _mm_slli_si128(values, 2));
  values = _mm_add_epi16(values, _mm_slli_si128(values, 4));
  return _mm_add_epi16(values, _mm_slli_si128(values, 8));
}

// Lanes that are all ones, of two masks: one bit for each in two bytes.
uint32_t Bits(__m128i low, __m128i high) {
  return static_cast<uint32_t>(_mm_movemask_epi8(_mm_packs_epi16(low, high)));
}

uint32_t FirstLane(__m128i words) {
  return static_cast<uint32_t>(_mm_cvtsi128_si32(words)) & 0xffff;
}

struct Words {
  __m128i words, types, rows, columns, times;

  __m128i Are(uint32_t type) const { return _mm_cmpeq_epi16(types, Spread(type)); }
};

// The same in every lane.
struct Held {
  __m128i row, time, base;
};

// Of each word, as it stands in an event.
struct Places {
  __m128i time_low, column, row_polarity;
};

// The first of them first.
struct Events {
  __m256i first, second;
};
Events Join(const Places& places, __m256i high_us, uint32_t set) {
  const __m128i lanes = Row(kCompress, set);
  const __m256i time_us =
      _mm256_add_epi32(_mm256_cvtepu16_epi32(_mm_shuffle_epi8(places.time_low, lanes)), high_us);
  const __m128i column = _mm_shuffle_epi8(places.column, lanes);
  const __m128i row = _mm_shuffle_epi8(places.row_polarity, lanes);
  const __m256i place = _mm256_inserti128_si256(
      _mm256_castsi128_si256(_mm_unpacklo_epi16(column, row)), _mm_unpackhi_epi16(column, row), 1);
  const __m256i outer = _mm256_unpacklo_epi32(time_us, place);
  const __m256i inner = _mm256_unpackhi_epi32(time_us, place);
  return {_mm256_permute2x128_si256(outer, inner, 0x20),
          _mm256_permute2x128_si256(outer, inner, 0x31)};
}

void Store(__m256i events, void* to) { _mm256_storeu_si256(static_cast<__m256i*>(to), events); }

// One event, or those of a vector, from each word of `set`.
PackedEvent* SpreadEvents(const Events& events, __m128i pixels, uint32_t set, PackedEvent* to) {
  alignas(32) uint64_t first[kLanes];
  alignas(16) uint16_t masks[kLanes];
  Store(events.first, first);
  Store(events.second, first + 4);
  _mm_store_si128(reinterpret_cast<__m128i*>(masks), _mm_shuffle_epi8(pixels, Row(kCompress, set)));
  const auto spread = [&](int i) {
    __m256i event = _mm256_set1_epi64x(static_cast<long long>(first[i]));
    uint32_t mask = masks[i];
    for (int part = 0; part < 3; ++part) {
      const __m256i* const steps = reinterpret_cast<const __m256i*>(kSteps.steps[mask & 0xf]);
      Store(_mm256_add_epi64(event, _mm256_load_si256(steps)), to);
      to += __builtin_popcount(mask & 0xf);
      event = _mm256_add_epi64(event, _mm256_set1_epi64x(int64_t{4} << 32));
      mask >>= 4;
    }
  };
  // Behind the last word of `set` the masks are empty. To stop there would be mispredicted.
  for (int i = 0; i < kLanes / 2; ++i) spread(i);
  if (__builtin_popcount(set) > kLanes / 2) {
    for (int i = kLanes / 2; i < kLanes; ++i) spread(i);
  }
  return to;
}

struct Vectors {
  __m128i set, eight;
  __m128i base;       // of the words that are vectors: column * 2 + polarity
  __m128i base_next;  // behind the last word, in every lane
  bool good;
};

Vectors TakeVectors(const Words& block, const Evt3State& limits, __m128i base_before) {
  const __m128i twelve = block.Are(0x4), bases = block.Are(0x3);
  Vectors vectors;
  vectors.eight = block.Are(0x5);
  vectors.set = _mm_or_si128(twelve, vectors.eight);
  const __m128i idle = _mm_or_si128(
      _mm_or_si128(block.Are(0x7), block.Are(0xE)),
      _mm_or_si128(block.Are(0xF), _mm_cmpeq_epi16(block.words, Spread(limits.known_high))));
  const __m128i known = _mm_or_si128(
      _mm_or_si128(_mm_or_si128(block.rows, block.columns), _mm_or_si128(block.times, bases)),
      _mm_or_si128(vectors.set, idle));
  const __m128i length =
      _mm_or_si128(_mm_and_si128(twelve, Spread(24)), _mm_and_si128(vectors.eight, Spread(16)));
  const __m128i behind = SumForward(length);
  const __m128i here = _mm_sub_epi16(behind, length);
  // Relative to the lengths before it a base holds as a row does.
  const __m128i told = _mm_or_si128(_mm_and_si128(_mm_slli_epi16(block.words, 1), Spread(0xffe)),
                                    _mm_and_si128(_mm_srli_epi16(block.words, 11), Spread(1)));
  const __m128i origin =
      FillForward(Bits(bases, bases) & 0xff, _mm_sub_epi16(told, here), base_before);
  vectors.base = _mm_add_epi16(origin, here);
  const __m128i next = _mm_add_epi16(origin, behind);
  vectors.base_next = SpreadLast(next);
  const __m128i outside =
      _mm_and_si128(vectors.set, _mm_cmpgt_epi16(_mm_srli_epi16(next, 1), Spread(limits.width)));
  vectors.good = Bits(known, outside) == 0x00ff;
  return vectors;
}

Evt3Kernel::Position DecodeAvx2(Evt3Kernel::Position from, const uint8_t* end,
                                const PackedEvent* full, Evt3State* state) {
  const Evt3State limits = *state;
  const __m128i last_column = Spread(limits.width - 1), last_row = Spread(limits.height - 1);
  const __m256i high_us = _mm256_set1_epi32(static_cast<int>(limits.high_us));
  const __m128i known_high = Spread(limits.known_high);
  Held held{Spread(limits.y), Spread(limits.time_low), Spread(limits.base)};
  const uint8_t* at = from.at;
  PackedEvent* to = from.to;
  for (; static_cast<size_t>(end - at) >= 2 * Evt3Kernel::kBlockWords && to < full;
       at += 2 * kLanes) {
    Words block;
    block.words = _mm_loadu_si128(reinterpret_cast<const __m128i*>(at));
    block.types = _mm_srli_epi16(block.words, 12);
    block.rows = block.Are(0x0);
    block.columns = block.Are(0x2);
    block.times = block.Are(0x6);
    const __m128i place = _mm_and_si128(block.words, Spread(0x7ff));
    const __m128i outside =
        _mm_or_si128(_mm_and_si128(block.columns, _mm_cmpgt_epi16(place, last_column)),
                     _mm_and_si128(block.rows, _mm_cmpgt_epi16(place, last_row)));
    const __m128i strange = _mm_cmpeq_epi16(
        _mm_or_si128(_mm_or_si128(block.rows, block.columns),
                     _mm_or_si128(block.times, _mm_cmpeq_epi16(block.words, known_high))),
        _mm_setzero_si128());
    const uint32_t rows_columns = Bits(block.rows, block.columns);
    const uint32_t columns = rows_columns >> 8;
    const uint32_t times_strange = Bits(block.times, strange);
    if (_mm_testz_si128(outside, outside) == 0) break;
    const __m128i row = FillForward(rows_columns & 0xff, place, held.row);
    Places places;
    places.time_low =
        FillForward(times_strange & 0xff, _mm_and_si128(block.words, Spread(0xfff)), held.time);
    places.column = place;
    places.row_polarity =
        _mm_or_si128(row, _mm_slli_epi16(_mm_and_si128(block.words, Spread(0x800)), 4));
    if (times_strange >> 8 == 0) {
      const Events events = Join(places, high_us, columns);
      Store(events.first, to);
      Store(events.second, to + 4);
      to += __builtin_popcount(columns);
    } else {
      const Vectors vectors = TakeVectors(block, limits, held.base);
      if (!vectors.good) break;
      places.column = _mm_blendv_epi8(place, _mm_srli_epi16(vectors.base, 1), vectors.set);
      places.row_polarity = _mm_blendv_epi8(
          places.row_polarity, _mm_or_si128(row, _mm_slli_epi16(vectors.base, 15)), vectors.set);
      const __m128i length_mask = _mm_blendv_epi8(Spread(0xfff), Spread(0xff), vectors.eight);
      const __m128i pixels =
          _mm_blendv_epi8(_mm_and_si128(block.words, length_mask), Spread(1), block.columns);
      const uint32_t set = Bits(_mm_or_si128(block.columns, vectors.set), vectors.set) & 0xff;
      to = SpreadEvents(Join(places, high_us, set), pixels, set, to);
      held.base = vectors.base_next;
    }
    held.row = SpreadLast(row);
    held.time = SpreadLast(places.time_low);
  }
  state->y = FirstLane(held.row);
  state->time_low = FirstLane(held.time);
  state->base = FirstLane(held.base);
  return {at, to};
}

}  // namespace

extern const Evt3Kernel kAvx2Evt3Kernel;
const Evt3Kernel kAvx2Evt3Kernel = {"avx2", &DecodeAvx2};

}  // namespace rigcal::agent
