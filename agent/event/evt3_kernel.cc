// SPDX-License-Identifier: Apache-2.0
#include "agent/event/evt3_kernel.h"

namespace rigcal::agent {

extern const Evt3Kernel kPortableEvt3Kernel;
#if defined(__x86_64__)
extern const Evt3Kernel kAvx2Evt3Kernel;
extern const Evt3Kernel kAvx512Evt3Kernel;
#endif

std::vector<const Evt3Kernel*> AvailableEvt3Kernels() {
  std::vector<const Evt3Kernel*> kernels = {&kPortableEvt3Kernel};
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("popcnt")) {
    kernels.push_back(&kAvx2Evt3Kernel);
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
        __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512cd")) {
      kernels.push_back(&kAvx512Evt3Kernel);
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
