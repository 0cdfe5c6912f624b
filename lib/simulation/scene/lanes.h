/// Eight floats at a time, through the vector extensions of GCC and clang: what the picture's inner loops compute with.
/// Every operation is exactly rounded, lane by lane, so the result does not depend on how pixels are grouped in lanes.
#pragma once

#ifdef __AVX__
#include <immintrin.h>
#endif

#include <cmath>
#include <cstdint>
#include <cstring>

namespace roadfix {

inline constexpr int kLanes = 8;
using F8 = float __attribute__((vector_size(32)));
using I8 = std::int32_t __attribute__((vector_size(32)));
using I4x64 = std::int64_t __attribute__((vector_size(32)));
using U8 = std::uint32_t __attribute__((vector_size(32)));

inline F8 splat(float x) { return F8{x, x, x, x, x, x, x, x}; }
inline U8 splat(std::uint32_t x) { return U8{x, x, x, x, x, x, x, x}; }
/// Lanes of a mask are 0 or -1. With AVX one instruction, where the compiler would compare the mask with zero first.
inline F8 select(I8 mask, F8 yes, F8 no) {
#ifdef __AVX__
  return (F8)_mm256_blendv_ps((__m256)no, (__m256)yes, (__m256)mask);
#else
  return mask ? yes : no;
#endif
}
inline U8 select(I8 mask, U8 yes, U8 no) { return (U8)select(mask, (F8)yes, (F8)no); }
inline I8 select(I8 mask, I8 yes, I8 no) { return (I8)select(mask, (F8)yes, (F8)no); }
inline F8 load(const float* from) {
  F8 x;
  std::memcpy(&x, from, sizeof x);
  return x;
}
inline U8 load(const std::uint32_t* from) {
  U8 x;
  std::memcpy(&x, from, sizeof x);
  return x;
}
/// The first `count` lanes.
template <class Element, class Lanes>
void store(Element* to, const Lanes& x, int count) {
  static_assert(sizeof(Element) * kLanes == sizeof(Lanes));
  if (count == kLanes) {
    std::memcpy(to, &x, sizeof x);
  } else {
    std::memcpy(to, &x, static_cast<std::size_t>(count) * sizeof(Element));
  }
}
/// table[index], lane by lane.
inline F8 look_up(const float* table, I8 index) {
#ifdef __AVX2__
  return (F8)_mm256_i32gather_ps(table, (__m256i)index, sizeof(float));
#else
  F8 x;
  for (int i = 0; i < kLanes; ++i) x[i] = table[index[i]];
  return x;
#endif
}
/// Makes of eight rows of eight the eight columns.
inline void transpose(F8 (&x)[kLanes]) {
  F8 y[kLanes];
  for (int i = 0; i < kLanes; i += 2) {
    y[i] = __builtin_shufflevector(x[i], x[i + 1], 0, 8, 1, 9, 4, 12, 5, 13);
    y[i + 1] = __builtin_shufflevector(x[i], x[i + 1], 2, 10, 3, 11, 6, 14, 7, 15);
  }
  for (int i = 0; i < 2; ++i) {
    for (int k = 0; k < 2; ++k) {
      x[4 * i + 2 * k] = __builtin_shufflevector(y[4 * i + k], y[4 * i + k + 2], 0, 1, 8, 9, 4, 5, 12, 13);
      x[4 * i + 2 * k + 1] = __builtin_shufflevector(y[4 * i + k], y[4 * i + k + 2], 2, 3, 10, 11, 6, 7, 14, 15);
    }
  }
  for (int i = 0; i < 4; ++i) {
    y[i] = __builtin_shufflevector(x[i], x[i + 4], 0, 1, 2, 3, 8, 9, 10, 11);
    y[i + 4] = __builtin_shufflevector(x[i], x[i + 4], 4, 5, 6, 7, 12, 13, 14, 15);
  }
  for (int i = 0; i < kLanes; ++i) x[i] = y[i];
}
/// b where neither is smaller (greater), as the processor's own instructions have it.
#ifdef __AVX__
inline F8 min(F8 a, F8 b) { return (F8)_mm256_min_ps((__m256)a, (__m256)b); }
inline F8 max(F8 a, F8 b) { return (F8)_mm256_max_ps((__m256)a, (__m256)b); }
#else
inline F8 min(F8 a, F8 b) { return select(a < b, a, b); }
inline F8 max(F8 a, F8 b) { return select(a > b, a, b); }
#endif
inline F8 abs(F8 a) { return max(a, -a); }
inline F8 clamp(F8 x, F8 lo, F8 hi) { return min(max(x, lo), hi); }
inline F8 clamp01(F8 x) { return clamp(x, splat(0.0F), splat(1.0F)); }
/// One instruction where the compiler, minding errno, would make eight calls; the bits are the same.
inline F8 root(F8 x) {
#ifdef __AVX__
  return (F8)_mm256_sqrt_ps((__m256)x);
#else
  for (int i = 0; i < kLanes; ++i) x[i] = std::sqrt(x[i]);
  return x;
#endif
}
/// a * b + c, rounded once.
inline F8 fused(F8 a, F8 b, F8 c) {
#ifdef __FMA__
  return (F8)_mm256_fmadd_ps((__m256)a, (__m256)b, (__m256)c);
#else
  for (int i = 0; i < kLanes; ++i) c[i] = std::fma(a[i], b[i], c[i]);
  return c;
#endif
}
inline F8 mix(F8 a, F8 b, F8 share) { return a + (b - a) * share; }
inline F8 to_float(I8 x) { return __builtin_convertvector(x, F8); }
inline I8 to_int(F8 x) { return __builtin_convertvector(x, I8); }
/// Both wrap around: lanes whose ray hit nothing carry any number and must not overflow.
inline I8 add_wrapping(I8 a, I8 b) { return (I8)((U8)a + (U8)b); }
inline I8 multiply_wrapping(I8 a, I8 b) { return (I8)((U8)a * (U8)b); }
/// For |x| < 2^31; a comparison gives -1 where it holds, which is the correction of the truncation.
inline I8 floor_int(F8 x) {
  const I8 truncated = to_int(x);
  return add_wrapping(truncated, to_float(truncated) > x);
}
inline bool any(I8 mask) {
#ifdef __AVX__
  return _mm256_testz_si256((__m256i)mask, (__m256i)mask) == 0;
#else
  const auto x = (I4x64)mask;
  return ((x[0] | x[1]) | (x[2] | x[3])) != 0;
#endif
}
inline float smallest(F8 x) {
  float m = x[0];
  for (int i = 1; i < kLanes; ++i) m = x[i] < m ? x[i] : m;
  return m;
}
inline float largest(F8 x) { return -smallest(-x); }

/// Mixes the bits of h: the finaliser of MurmurHash3 (Appleby, 2011).
inline U8 mix_bits(U8 h) {
  h ^= h >> 16;
  h *= 0x85EBCA6BU;
  h ^= h >> 13;
  h *= 0xC2B2AE35U;
  return h ^ (h >> 16);
}
/// A number for the lattice cell (x, y) of a surface.
inline U8 hash_cell(I8 x, I8 y, U8 key) { return mix_bits((U8)x * 0x9E3779B1U ^ mix_bits((U8)y * 0x85EBCA77U + key)); }
/// The bits [shift, shift + 8) of h as a number in [0, 1).
inline F8 fraction(U8 h, unsigned shift) { return to_float((I8)((h >> shift) & 0xFFU)) * (1.0F / 256.0F); }

}  // namespace roadfix
