// SPDX-License-Identifier: Apache-2.0
#pragma once

// Eight doubles that go through the same arithmetic side by side: in the line bundle's kernel, one
// lane is one instant. Compiled once per instruction set into a namespace of its own
// (RIGCAL_KERNEL), so that no inline function of one set is ever linked in the place of another's.
// The lanes are eight with every set and nothing is fused or reordered: the same bits on every CPU.
#ifndef RIGCAL_KERNEL
#error "only the kernel's own source files include this, with RIGCAL_KERNEL defined"
#endif

#define RIGCAL_INLINE __attribute__((always_inline)) inline

namespace rigcal::server::RIGCAL_KERNEL {

constexpr int kLanes = 8;
#if defined(__AVX512F__)
constexpr int kWidth = 8;
#elif defined(__AVX2__)
constexpr int kWidth = 4;
#else
constexpr int kWidth = 2;
#endif
constexpr int kParts = kLanes / kWidth;

typedef double Native __attribute__((vector_size(kWidth * 8)));
typedef double NativeAnywhere __attribute__((vector_size(kWidth * 8), aligned(8), may_alias));
typedef long long NativeBits __attribute__((vector_size(kWidth * 8)));

struct Mask {
  NativeBits part[kParts];
};

struct Lanes {
  Native part[kParts];

  Lanes() = default;
  RIGCAL_INLINE Lanes(double value) {  // NOLINT: a number is the same number in every lane
    for (Native& p : part) p = value - Native{};
  }
  RIGCAL_INLINE double operator[](int lane) const { return part[lane / kWidth][lane % kWidth]; }
  RIGCAL_INLINE void Set(int lane, double value) { part[lane / kWidth][lane % kWidth] = value; }
};

RIGCAL_INLINE Lanes Load(const double* from) {
  Lanes result;
  for (int i = 0; i < kParts; ++i) {
    result.part[i] = *reinterpret_cast<const NativeAnywhere*>(from + i * kWidth);
  }
  return result;
}
RIGCAL_INLINE void Store(const Lanes& lanes, double* to) {
  for (int i = 0; i < kParts; ++i) {
    *reinterpret_cast<NativeAnywhere*>(to + i * kWidth) = lanes.part[i];
  }
}

#define RIGCAL_LANES_OPERATOR(op)                                             \
  RIGCAL_INLINE Lanes operator op(const Lanes& a, const Lanes& b) {           \
    Lanes result;                                                             \
    for (int i = 0; i < kParts; ++i) result.part[i] = a.part[i] op b.part[i]; \
    return result;                                                            \
  }                                                                           \
  RIGCAL_INLINE Lanes& operator op##=(Lanes& a, const Lanes& b) { return a = a op b; }
RIGCAL_LANES_OPERATOR(+)
RIGCAL_LANES_OPERATOR(-)
RIGCAL_LANES_OPERATOR(*)
RIGCAL_LANES_OPERATOR(/)
#undef RIGCAL_LANES_OPERATOR

#define RIGCAL_LANES_COMPARISON(op)                                                         \
  RIGCAL_INLINE Mask operator op(const Lanes& a, const Lanes& b) {                          \
    Mask result;                                                                            \
    for (int i = 0; i < kParts; ++i) result.part[i] = (NativeBits)(a.part[i] op b.part[i]); \
    return result;                                                                          \
  }
RIGCAL_LANES_COMPARISON(<)
RIGCAL_LANES_COMPARISON(>)
#undef RIGCAL_LANES_COMPARISON

RIGCAL_INLINE Lanes operator-(const Lanes& a) {
  Lanes result;
  for (int i = 0; i < kParts; ++i) result.part[i] = -a.part[i];
  return result;
}
RIGCAL_INLINE Mask operator&(const Mask& a, const Mask& b) {
  Mask result;
  for (int i = 0; i < kParts; ++i) result.part[i] = a.part[i] & b.part[i];
  return result;
}
RIGCAL_INLINE Lanes Select(const Mask& mask, const Lanes& yes, const Lanes& no) {
  Lanes result;
  for (int i = 0; i < kParts; ++i) result.part[i] = mask.part[i] ? yes.part[i] : no.part[i];
  return result;
}
RIGCAL_INLINE Lanes Max(const Lanes& a, const Lanes& b) { return Select(a > b, a, b); }
RIGCAL_INLINE Lanes Min(const Lanes& a, const Lanes& b) { return Select(a < b, a, b); }
RIGCAL_INLINE Lanes Abs(const Lanes& a) { return Max(a, -a); }
RIGCAL_INLINE Lanes Sqrt(const Lanes& a) {
  Lanes result;
  for (int lane = 0; lane < kLanes; ++lane) result.Set(lane, __builtin_sqrt(a[lane]));
  return result;
}
RIGCAL_INLINE Lanes Atan2(const Lanes& y, const Lanes& x) {
  Lanes result;
  for (int lane = 0; lane < kLanes; ++lane) result.Set(lane, __builtin_atan2(y[lane], x[lane]));
  return result;
}
// In one fixed order.
RIGCAL_INLINE double Sum(const Lanes& a) {
  return ((a[0] + a[1]) + (a[2] + a[3])) + ((a[4] + a[5]) + (a[6] + a[7]));
}

// rows[i] lane j <-> rows[j] lane i.
RIGCAL_INLINE void TransposeSquare(Lanes (&rows)[kLanes]) {
#if defined(__AVX512F__)
  Native t[8], u[8];
  for (int i = 0; i < 8; i += 2) {
    const Native a = rows[i].part[0], b = rows[i + 1].part[0];
    t[i] = __builtin_shufflevector(a, b, 0, 8, 2, 10, 4, 12, 6, 14);
    t[i + 1] = __builtin_shufflevector(a, b, 1, 9, 3, 11, 5, 13, 7, 15);
  }
  for (int i = 0; i < 8; ++i) {
    if (i & 2) continue;
    u[i] = __builtin_shufflevector(t[i], t[i + 2], 0, 1, 8, 9, 4, 5, 12, 13);
    u[i + 2] = __builtin_shufflevector(t[i], t[i + 2], 2, 3, 10, 11, 6, 7, 14, 15);
  }
  for (int i = 0; i < 4; ++i) {
    rows[i].part[0] = __builtin_shufflevector(u[i], u[i + 4], 0, 1, 2, 3, 8, 9, 10, 11);
    rows[i + 4].part[0] = __builtin_shufflevector(u[i], u[i + 4], 4, 5, 6, 7, 12, 13, 14, 15);
  }
#elif defined(__AVX2__)
  Lanes out[kLanes];
  for (int r = 0; r < 2; ++r) {
    for (int c = 0; c < 2; ++c) {
      Native t[4];
      for (int i = 0; i < 4; i += 2) {
        const Native a = rows[4 * r + i].part[c], b = rows[4 * r + i + 1].part[c];
        t[i] = __builtin_shufflevector(a, b, 0, 4, 2, 6);
        t[i + 1] = __builtin_shufflevector(a, b, 1, 5, 3, 7);
      }
      for (int i = 0; i < 2; ++i) {
        out[4 * c + i].part[r] = __builtin_shufflevector(t[i], t[i + 2], 0, 1, 4, 5);
        out[4 * c + i + 2].part[r] = __builtin_shufflevector(t[i], t[i + 2], 2, 3, 6, 7);
      }
    }
  }
  for (int i = 0; i < kLanes; ++i) rows[i] = out[i];
#else
  Lanes out[kLanes];
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c) {
      const Native a = rows[2 * r].part[c], b = rows[2 * r + 1].part[c];
      out[2 * c].part[r] = __builtin_shufflevector(a, b, 0, 2);
      out[2 * c + 1].part[r] = __builtin_shufflevector(a, b, 1, 3);
    }
  }
  for (int i = 0; i < kLanes; ++i) rows[i] = out[i];
#endif
}

// Sum of logarithms of values >= 1 for the price of a multiplication each: the product is kept as
// a mantissa in [1, 2) and an exponent.
struct LogSum {
  Native mantissa[kParts];
  NativeBits exponent[kParts];

  RIGCAL_INLINE LogSum() {
    for (int i = 0; i < kParts; ++i) {
      mantissa[i] = 1.0 - Native{};
      exponent[i] = NativeBits{};
    }
  }
  RIGCAL_INLINE void Add(const Lanes& value) {
    for (int i = 0; i < kParts; ++i) {
      const Native product = mantissa[i] * value.part[i];
      const NativeBits bits = (NativeBits)product;
      exponent[i] += (bits >> 52) - 1023;
      mantissa[i] = (Native)((bits & 0x000fffffffffffffLL) | 0x3ff0000000000000LL);
    }
  }
  RIGCAL_INLINE Lanes Value() const {
    Lanes result;
    for (int lane = 0; lane < kLanes; ++lane) {
      const int i = lane / kWidth, j = lane % kWidth;
      result.Set(lane, __builtin_log(mantissa[i][j]) +
                           static_cast<double>(exponent[i][j]) * 0.693147180559945309417);
    }
    return result;
  }
};

}  // namespace rigcal::server::RIGCAL_KERNEL
