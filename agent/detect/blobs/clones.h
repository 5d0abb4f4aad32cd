// SPDX-License-Identifier: Apache-2.0
#pragma once

// A function that is compiled for AVX2 and AVX-512 too; which one runs is decided at run time. Its
// arithmetic is the same. Not with sanitizers, which cannot follow how it is chosen.
#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define RIGCAL_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define RIGCAL_CLONES
#endif
