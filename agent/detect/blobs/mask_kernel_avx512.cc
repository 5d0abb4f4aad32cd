// SPDX-License-Identifier: Apache-2.0
// Only intrinsics, functions of this file and templates over its types: code of others compiled
// here could end up being used on a CPU without AVX-512. Only F and BW are needed.
#include <immintrin.h>

#include "agent/detect/blobs/mask_kernel.h"
#include "agent/detect/blobs/mask_kernel_rows.h"

namespace rigcal::agent {
namespace {

struct Avx512 {
  using Register = __m512i;

  static constexpr int kLanes = 64;

  static Register Spread(uint8_t level) { return _mm512_set1_epi8(static_cast<char>(level)); }
  static Register Low(Register bytes) {
    return _mm512_unpacklo_epi8(bytes, _mm512_setzero_si512());
  }
  static Register High(Register bytes) {
    return _mm512_unpackhi_epi8(bytes, _mm512_setzero_si512());
  }
  static Register Spread16(int16_t number) { return _mm512_set1_epi16(number); }
  static Register Subtract16(Register a, Register b) { return _mm512_sub_epi16(a, b); }
  static Register MultiplyHigh16(Register a, Register b) { return _mm512_mulhi_epi16(a, b); }
  static Register Greater16(Register a, Register b) {
    return _mm512_movm_epi16(_mm512_cmpgt_epi16_mask(a, b));
  }
  static Register Pack(Register low, Register high) { return _mm512_packs_epi16(low, high); }

  static bool AnyAbove(const uint8_t* pixels, Register below);
  static uint64_t BitsAbove(const uint8_t* pixels, Register below);
  static uint64_t MaskBlock(const IntegerColourRange& range, const uint8_t* pixels);
};

using Rows = MaskRows<Avx512>;
using Planes = Rows::Planes;
constexpr int kLanes = Avx512::kLanes;

__m512i Load(const uint8_t* bytes) { return _mm512_loadu_si512(bytes); }

// 16 bytes from each of four groups of 16 pixels.
__m512i LoadQuarters(const uint8_t* bytes) {
  const auto quarter = [bytes](int i) {
    return _mm_loadu_si128(reinterpret_cast<const __m128i*>(bytes + 48 * i));
  };
  const __m512i one = _mm512_inserti32x4(_mm512_castsi128_si512(quarter(0)), quarter(1), 1);
  return _mm512_inserti32x4(_mm512_inserti32x4(one, quarter(2), 2), quarter(3), 3);
}

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

__mmask64 InHalfPlane(const HueHalfPlane& plane, const Planes& planes) {
  return _mm512_movepi8_mask(Rows::InHalfPlane(plane, planes));
}

// Most bright pixels have too little colour: only where one has enough is its hue asked for.
uint64_t Avx512::MaskBlock(const IntegerColourRange& range, const uint8_t* pixels) {
  Planes planes;
  Deinterleave(pixels, &planes);
  const __m512i blue = planes.channel[kBlue];
  const __m512i green = planes.channel[kGreen];
  const __m512i red = planes.channel[kRed];
  const __m512i value = _mm512_max_epu8(_mm512_max_epu8(blue, green), red);
  const __m512i smallest = _mm512_min_epu8(_mm512_min_epu8(blue, green), red);
  const __mmask64 bright = _mm512_cmpgt_epu8_mask(value, Avx512::Spread(range.value_below));
  uint64_t taken =
      bright & _mm512_cmpgt_epu8_mask(smallest, Avx512::Spread(range.washed_out_below));
  if (range.takes_grey) taken |= bright & _mm512_cmpeq_epi8_mask(smallest, value);

  const __m512i share = _mm512_set1_epi16(static_cast<int16_t>(range.grey_share));
  const __m512i limit = _mm512_packus_epi16(_mm512_mulhi_epu16(Avx512::Low(value), share),
                                            _mm512_mulhi_epu16(Avx512::High(value), share));
  const __mmask64 coloured = bright & _mm512_cmple_epu8_mask(smallest, limit);
  if (coloured != 0) {
    const __mmask64 inside = InHalfPlane(range.from, planes) & InHalfPlane(range.to, planes);
    taken |= coloured & (inside ^ (range.outside ? ~uint64_t{0} : 0));
  }
  return taken;
}

bool Avx512::AnyAbove(const uint8_t* pixels, Register below) {
  const Register largest = _mm512_max_epu8(_mm512_max_epu8(Load(pixels), Load(pixels + kLanes)),
                                           Load(pixels + 2 * kLanes));
  return _mm512_cmpgt_epu8_mask(largest, below) != 0;
}

uint64_t Avx512::BitsAbove(const uint8_t* pixels, Register below) {
  return _mm512_cmpgt_epu8_mask(Load(pixels), below);
}

}  // namespace

extern const MaskKernel kAvx512MaskKernel;
const MaskKernel kAvx512MaskKernel = {"avx512", Rows::Bgr, Rows::Mono};

}  // namespace rigcal::agent
