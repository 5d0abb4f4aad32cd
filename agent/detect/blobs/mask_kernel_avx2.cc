// SPDX-License-Identifier: Apache-2.0
// Only intrinsics, functions of this file and templates over its types: code of others compiled
// here could end up being used on a CPU without AVX2.
#include <immintrin.h>

#include "agent/detect/blobs/mask_kernel.h"
#include "agent/detect/blobs/mask_kernel_rows.h"

namespace rigcal::agent {
namespace {

struct Avx2 {
  using Register = __m256i;

  static constexpr int kLanes = 32;

  static Register Spread(uint8_t level) { return _mm256_set1_epi8(static_cast<char>(level)); }
  static Register Low(Register bytes) {
    return _mm256_unpacklo_epi8(bytes, _mm256_setzero_si256());
  }
  static Register High(Register bytes) {
    return _mm256_unpackhi_epi8(bytes, _mm256_setzero_si256());
  }
  static Register Spread16(int16_t number) { return _mm256_set1_epi16(number); }
  static Register Subtract16(Register a, Register b) { return _mm256_sub_epi16(a, b); }
  static Register MultiplyHigh16(Register a, Register b) { return _mm256_mulhi_epi16(a, b); }
  static Register Greater16(Register a, Register b) { return _mm256_cmpgt_epi16(a, b); }
  static Register Pack(Register low, Register high) { return _mm256_packs_epi16(low, high); }

  static bool AnyAbove(const uint8_t* pixels, Register below);
  static uint64_t BitsAbove(const uint8_t* pixels, Register below);
  static uint64_t MaskBlock(const IntegerColourRange& range, const uint8_t* pixels);
};

using Rows = MaskRows<Avx2>;
using Planes = Rows::Planes;
constexpr int kLanes = Avx2::kLanes;

__m256i Load(const uint8_t* bytes) {
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(bytes));
}

__m256i LoadHalves(const uint8_t* low, const uint8_t* high) {
  return _mm256_inserti128_si256(
      _mm256_castsi128_si256(_mm_loadu_si128(reinterpret_cast<const __m128i*>(low))),
      _mm_loadu_si128(reinterpret_cast<const __m128i*>(high)), 1);
}

// Places whose number modulo 3 is 0, 1, 2, in either half.
__m256i Places(int remainder) {
  const __m256i places = _mm256_setr_epi8(0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 0, 1, 2,
                                          0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0);
  return _mm256_cmpeq_epi8(places, _mm256_set1_epi8(static_cast<char>(remainder)));
}

// 32 pixels. In 48 bytes (16 pixels) the bytes of one channel lie at places that differ in each of
// the three vectors, so that blending brings them together and one shuffle sorts them.
void Deinterleave(const uint8_t* pixels, Planes* planes) {
  const __m256i a = LoadHalves(pixels, pixels + 48);
  const __m256i b = LoadHalves(pixels + 16, pixels + 64);
  const __m256i c = LoadHalves(pixels + 32, pixels + 80);
  const __m256i ones = Places(1);
  const __m256i twos = Places(2);
  const __m256i blue = _mm256_blendv_epi8(_mm256_blendv_epi8(a, b, twos), c, ones);
  const __m256i green = _mm256_blendv_epi8(_mm256_blendv_epi8(b, a, ones), c, twos);
  const __m256i red = _mm256_blendv_epi8(_mm256_blendv_epi8(c, b, ones), a, twos);
  const __m256i blue_order = _mm256_setr_epi8(0, 3, 6, 9, 12, 15, 2, 5, 8, 11, 14, 1, 4, 7, 10, 13,
                                              0, 3, 6, 9, 12, 15, 2, 5, 8, 11, 14, 1, 4, 7, 10, 13);
  const __m256i green_order =
      _mm256_setr_epi8(1, 4, 7, 10, 13, 0, 3, 6, 9, 12, 15, 2, 5, 8, 11, 14, 1, 4, 7, 10, 13, 0, 3,
                       6, 9, 12, 15, 2, 5, 8, 11, 14);
  const __m256i red_order = _mm256_setr_epi8(2, 5, 8, 11, 14, 1, 4, 7, 10, 13, 0, 3, 6, 9, 12, 15,
                                             2, 5, 8, 11, 14, 1, 4, 7, 10, 13, 0, 3, 6, 9, 12, 15);
  planes->channel[kBlue] = _mm256_shuffle_epi8(blue, blue_order);
  planes->channel[kGreen] = _mm256_shuffle_epi8(green, green_order);
  planes->channel[kRed] = _mm256_shuffle_epi8(red, red_order);
}

// Bytes are 0 exactly where `bytes` are not larger than `below`.
__m256i Above(__m256i bytes, __m256i below) { return _mm256_subs_epu8(bytes, below); }

// All bits of bytes that are not larger than `below`.
__m256i NotAbove(__m256i bytes, __m256i below) {
  return _mm256_cmpeq_epi8(Above(bytes, below), _mm256_setzero_si256());
}

uint64_t Bits(__m256i first, __m256i second) {
  return static_cast<uint32_t>(_mm256_movemask_epi8(first)) |
         uint64_t{static_cast<uint32_t>(_mm256_movemask_epi8(second))} << kLanes;
}

// 32 pixels, but for their hue. All bits of a byte are set where it is true.
struct Brightness {
  __m256i coloured;   // bright enough and with enough colour
  __m256i not_plain;  // not taken without regard to the hue
};

Brightness AskBrightness(const IntegerColourRange& range, const Planes& planes) {
  const __m256i blue = planes.channel[kBlue];
  const __m256i green = planes.channel[kGreen];
  const __m256i red = planes.channel[kRed];
  const __m256i value = _mm256_max_epu8(_mm256_max_epu8(blue, green), red);
  const __m256i smallest = _mm256_min_epu8(_mm256_min_epu8(blue, green), red);
  const __m256i dark = NotAbove(value, Avx2::Spread(range.value_below));
  const __m256i grey = _mm256_and_si256(_mm256_cmpeq_epi8(smallest, value),
                                        Avx2::Spread(range.takes_grey ? 255 : 0));
  const __m256i refused =
      _mm256_andnot_si256(grey, NotAbove(smallest, Avx2::Spread(range.washed_out_below)));
  const __m256i share = _mm256_set1_epi16(static_cast<int16_t>(range.grey_share));
  const __m256i limit = _mm256_packus_epi16(_mm256_mulhi_epu16(Avx2::Low(value), share),
                                            _mm256_mulhi_epu16(Avx2::High(value), share));
  return {_mm256_andnot_si256(dark, NotAbove(smallest, limit)), _mm256_or_si256(refused, dark)};
}

__m256i InBothHalfPlanes(const IntegerColourRange& range, const Planes& planes) {
  return _mm256_and_si256(Rows::InHalfPlane(range.from, planes),
                          Rows::InHalfPlane(range.to, planes));
}

// Most bright pixels have too little colour: only where one has enough is its hue asked for.
uint64_t Avx2::MaskBlock(const IntegerColourRange& range, const uint8_t* pixels) {
  Planes first, second;
  Deinterleave(pixels, &first);
  Deinterleave(pixels + 3 * kLanes, &second);
  const Brightness a = AskBrightness(range, first);
  const Brightness b = AskBrightness(range, second);
  uint64_t taken = ~Bits(a.not_plain, b.not_plain);
  const uint64_t coloured = Bits(a.coloured, b.coloured);
  if (coloured != 0) {
    const uint64_t inside = Bits(InBothHalfPlanes(range, first), InBothHalfPlanes(range, second));
    taken |= coloured & (inside ^ (range.outside ? ~uint64_t{0} : 0));
  }
  return taken;
}

bool Avx2::AnyAbove(const uint8_t* pixels, Register below) {
  const Register first = _mm256_max_epu8(_mm256_max_epu8(Load(pixels), Load(pixels + kLanes)),
                                         Load(pixels + 2 * kLanes));
  const Register second =
      _mm256_max_epu8(_mm256_max_epu8(Load(pixels + 3 * kLanes), Load(pixels + 4 * kLanes)),
                      Load(pixels + 5 * kLanes));
  const Register above = Above(_mm256_max_epu8(first, second), below);
  return _mm256_testz_si256(above, above) == 0;
}

uint64_t Avx2::BitsAbove(const uint8_t* pixels, Register below) {
  return ~Bits(NotAbove(Load(pixels), below), NotAbove(Load(pixels + kLanes), below));
}

}  // namespace

extern const MaskKernel kAvx2MaskKernel;
const MaskKernel kAvx2MaskKernel = {"avx2", Rows::Bgr, Rows::Mono};

}  // namespace rigcal::agent
