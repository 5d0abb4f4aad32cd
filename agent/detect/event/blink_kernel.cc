// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_kernel.h"

namespace rigcal::agent {

extern const BlinkKernel kPortableBlinkKernel;
#if defined(__x86_64__)
extern const BlinkKernel kAvx512BlinkKernel;
#endif

std::vector<const BlinkKernel*> AvailableBlinkKernels() {
  std::vector<const BlinkKernel*> kernels = {&kPortableBlinkKernel};
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512cd")) {
    kernels.push_back(&kAvx512BlinkKernel);
  }
#endif
  return kernels;
}

const BlinkKernel& BestBlinkKernel() {
  static const BlinkKernel* const best = AvailableBlinkKernels().back();
  return *best;
}

}  // namespace rigcal::agent
