// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/mask_kernel.h"

namespace rigcal::agent {

extern const MaskKernel kPortableMaskKernel;
#if defined(__x86_64__)
extern const MaskKernel kAvx2MaskKernel;
extern const MaskKernel kAvx512MaskKernel;
#endif

std::vector<const MaskKernel*> AvailableMaskKernels() {
  std::vector<const MaskKernel*> kernels = {&kPortableMaskKernel};
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) kernels.push_back(&kAvx2MaskKernel);
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw")) {
    kernels.push_back(&kAvx512MaskKernel);
  }
#endif
  return kernels;
}

const MaskKernel& BestMaskKernel() {
  static const MaskKernel* const best = AvailableMaskKernels().back();
  return *best;
}

}  // namespace rigcal::agent
