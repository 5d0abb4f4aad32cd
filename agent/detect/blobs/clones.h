// SPDX-License-Identifier: Apache-2.0
#pragma once

// Compiles a function for AVX2 and AVX-512 too; which version runs is decided at run time. All do
// the same arithmetic. Sanitizers cannot follow how a version is chosen, so it is off with them.
#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define RIGCAL_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define RIGCAL_CLONES
#endif
