// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_kernel.h"

namespace rigcal::agent {

namespace blink_kernel_portable {
extern const BlinkKernel kKernel;
}
#if defined(__x86_64__)
namespace blink_kernel_avx512 {
extern const BlinkKernel kKernel;
}
#endif

std::vector<const BlinkKernel*> AvailableBlinkKernels() {
  std::vector<const BlinkKernel*> kernels = {&blink_kernel_portable::kKernel};
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512cd")) {
    kernels.push_back(&blink_kernel_avx512::kKernel);
  }
#endif
  return kernels;
}

const BlinkKernel& BestBlinkKernel() {
  static const BlinkKernel* const best = AvailableBlinkKernels().back();
  return *best;
}

}  // namespace rigcal::agent
