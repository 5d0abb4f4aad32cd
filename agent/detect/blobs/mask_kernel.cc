// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/mask_kernel.h"

namespace rigcal::agent {

namespace mask_kernel_portable {
extern const MaskKernel kKernel;
}
#if defined(__x86_64__)
namespace mask_kernel_avx2 {
extern const MaskKernel kKernel;
}
namespace mask_kernel_avx512 {
extern const MaskKernel kKernel;
}
#endif

std::vector<const MaskKernel*> AvailableMaskKernels() {
  std::vector<const MaskKernel*> kernels = {&mask_kernel_portable::kKernel};
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) kernels.push_back(&mask_kernel_avx2::kKernel);
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw")) {
    kernels.push_back(&mask_kernel_avx512::kKernel);
  }
#endif
  return kernels;
}

const MaskKernel& BestMaskKernel() {
  static const MaskKernel* const best = AvailableMaskKernels().back();
  return *best;
}

}  // namespace rigcal::agent
