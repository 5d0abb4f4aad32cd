// SPDX-License-Identifier: Apache-2.0
// Only intrinsics and functions of this file: code of others compiled here could end up being used
// on a CPU without AVX-512. Only F and BW are needed.
#include <immintrin.h>

#include "agent/detect/mask_kernel.h"

namespace rigcal::agent {
namespace {

constexpr int kBlock = 64;  // pixels of a word
constexpr int kCacheLine = 64;

__m512i Load(const uint8_t* bytes) { return _mm512_loadu_si512(bytes); }

// 16 bytes from each of four groups of 16 pixels.
__m512i LoadQuarters(const uint8_t* bytes) {
  const auto quarter = [bytes](int i) {
    return _mm_loadu_si128(reinterpret_cast<const __m128i*>(bytes + 48 * i));
  };
  const __m512i one = _mm512_inserti32x4(_mm512_castsi128_si512(quarter(0)), quarter(1), 1);
  return _mm512_inserti32x4(_mm512_inserti32x4(one, quarter(2), 2), quarter(3), 3);
}

struct Planes {
  __m512i channel[3];
};

// As with AVX2: in the three vectors the bytes of one channel lie at different places.
void Deinterleave(const uint8_t* pixels, Planes* planes) {
  const __m512i a = LoadQuarters(pixels);
  const __m512i b = LoadQuarters(pixels + 16);
  const __m512i c = LoadQuarters(pixels + 32);
  constexpr __mmask64 kOnes = 0x2492249224922492;  // places 1, 4, 7, 10, 13 of each quarter
  constexpr __mmask64 kTwos = 0x4924492449244924;
  const auto blend = _mm512_mask_blend_epi8;
  const __m512i blue = blend(kOnes, blend(kTwos, a, b), c);
  const __m512i green = blend(kTwos, blend(kOnes, b, a), c);
  const __m512i red = blend(kTwos, blend(kOnes, c, b), a);
  const auto order = [](__m128i quarter) { return _mm512_broadcast_i32x4(quarter); };
  planes->channel[kBlue] = _mm512_shuffle_epi8(
      blue, order(_mm_setr_epi8(0, 3, 6, 9, 12, 15, 2, 5, 8, 11, 14, 1, 4, 7, 10, 13)));
  planes->channel[kGreen] = _mm512_shuffle_epi8(
      green, order(_mm_setr_epi8(1, 4, 7, 10, 13, 0, 3, 6, 9, 12, 15, 2, 5, 8, 11, 14)));
  planes->channel[kRed] = _mm512_shuffle_epi8(
      red, order(_mm_setr_epi8(2, 5, 8, 11, 14, 1, 4, 7, 10, 13, 0, 3, 6, 9, 12, 15)));
}

__m512i Low(__m512i bytes) { return _mm512_unpacklo_epi8(bytes, _mm512_setzero_si512()); }
__m512i High(__m512i bytes) { return _mm512_unpackhi_epi8(bytes, _mm512_setzero_si512()); }

__m512i InHalfPlane16(__m512i plus, __m512i minus, __m512i slope_plus, __m512i slope_minus,
                      __m512i slope) {
  const __m512i run = _mm512_sub_epi16(slope_plus, slope_minus);
  return _mm512_movm_epi16(
      _mm512_cmpgt_epi16_mask(_mm512_sub_epi16(plus, minus), _mm512_mulhi_epi16(run, slope)));
}

__mmask64 InHalfPlane(const HueHalfPlane& plane, const Planes& planes) {
  const __m512i plus = planes.channel[plane.plus];
  const __m512i minus = planes.channel[plane.minus];
  const __m512i slope_plus = planes.channel[plane.slope_plus];
  const __m512i slope_minus = planes.channel[plane.slope_minus];
  const __m512i slope = _mm512_set1_epi16(plane.slope);
  return _mm512_movepi8_mask(_mm512_packs_epi16(
      InHalfPlane16(Low(plus), Low(minus), Low(slope_plus), Low(slope_minus), slope),
      InHalfPlane16(High(plus), High(minus), High(slope_plus), High(slope_minus), slope)));
}

__m512i Spread(uint8_t level) { return _mm512_set1_epi8(static_cast<char>(level)); }

// Most bright pixels have too little colour: only where one has enough is its hue asked for.
uint64_t MaskBlock(const IntegerColourRange& range, const uint8_t* pixels) {
  Planes planes;
  Deinterleave(pixels, &planes);
  const __m512i blue = planes.channel[kBlue];
  const __m512i green = planes.channel[kGreen];
  const __m512i red = planes.channel[kRed];
  const __m512i value = _mm512_max_epu8(_mm512_max_epu8(blue, green), red);
  const __m512i smallest = _mm512_min_epu8(_mm512_min_epu8(blue, green), red);
  const __mmask64 bright = _mm512_cmpgt_epu8_mask(value, Spread(range.value_below));
  uint64_t taken = bright & _mm512_cmpgt_epu8_mask(smallest, Spread(range.washed_out_below));
  if (range.takes_grey) taken |= bright & _mm512_cmpeq_epi8_mask(smallest, value);

  const __m512i share = _mm512_set1_epi16(static_cast<int16_t>(range.grey_share));
  const __m512i limit = _mm512_packus_epi16(_mm512_mulhi_epu16(Low(value), share),
                                            _mm512_mulhi_epu16(High(value), share));
  const __mmask64 coloured = bright & _mm512_cmple_epu8_mask(smallest, limit);
  if (coloured != 0) {
    const __mmask64 inside = InHalfPlane(range.from, planes) & InHalfPlane(range.to, planes);
    taken |= coloured & (inside ^ (range.outside ? ~uint64_t{0} : 0));
  }
  return taken;
}

// The lines that lie `ahead` bytes after `count` bytes, where no object need be.
void Prefetch(const uint8_t* bytes, ptrdiff_t ahead, int count) {
  const uintptr_t first = reinterpret_cast<uintptr_t>(bytes) + static_cast<uintptr_t>(ahead);
  for (int i = 0; i < count; i += kCacheLine) {
    const uintptr_t address = first + static_cast<uintptr_t>(i);
    _mm_prefetch(reinterpret_cast<const char*>(address), _MM_HINT_T0);
  }
}

// A word's pixels are first asked together, channels mixed, whether any is bright enough.
uint64_t MaskBgr(const IntegerColourRange& range, const uint8_t* pixels, ptrdiff_t next_row,
                 int word_count, uint64_t* words) {
  const __m512i below = Spread(range.value_below);
  uint64_t all = 0;
  for (int i = 0; i < word_count; ++i, pixels += 3 * kBlock) {
    Prefetch(pixels, next_row, 3 * kBlock);
    const __m512i largest = _mm512_max_epu8(_mm512_max_epu8(Load(pixels), Load(pixels + kBlock)),
                                            Load(pixels + 2 * kBlock));
    words[i] = _mm512_cmpgt_epu8_mask(largest, below) == 0 ? 0 : MaskBlock(range, pixels);
    all |= words[i];
  }
  return all;
}

uint64_t MaskMono(const IntegerColourRange& range, const uint8_t* pixels, ptrdiff_t next_row,
                  int word_count, uint64_t* words) {
  const __m512i below = Spread(range.value_below);
  uint64_t all = 0;
  for (int i = 0; i < word_count; ++i, pixels += kBlock) {
    Prefetch(pixels, next_row, kBlock);
    words[i] = _mm512_cmpgt_epu8_mask(Load(pixels), below);
    all |= words[i];
  }
  return all;
}

}  // namespace

extern const MaskKernel kAvx512MaskKernel;
const MaskKernel kAvx512MaskKernel = {"avx512", MaskBgr, MaskMono};

}  // namespace rigcal::agent
