// SPDX-License-Identifier: Apache-2.0
#include "agent/event/evt3_kernel.h"

namespace rigcal::agent {

#if defined(__x86_64__)
namespace evt3_kernel_avx2 {
extern const Evt3Kernel kKernel;
}
namespace evt3_kernel_avx512 {
extern const Evt3Kernel kKernel;
}
#endif

std::vector<const Evt3Kernel*> AvailableEvt3Kernels() {
  static constexpr Evt3Kernel kPortable = {"portable", nullptr};
  std::vector<const Evt3Kernel*> kernels = {&kPortable};
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("popcnt")) {
    kernels.push_back(&evt3_kernel_avx2::kKernel);
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
        __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512cd")) {
      kernels.push_back(&evt3_kernel_avx512::kKernel);
    }
  }
#endif
  return kernels;
}

const Evt3Kernel& BestEvt3Kernel() {
  static const Evt3Kernel* const best = AvailableEvt3Kernels().back();
  return *best;
}

}  // namespace rigcal::agent
