// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/line_bundle_kernel.h"

namespace rigcal::server {

namespace kernel_baseline {
extern const LineBundleKernel kKernel;
}
#if defined(__x86_64__)
namespace kernel_avx2 {
extern const LineBundleKernel kKernel;
}
namespace kernel_avx512 {
extern const LineBundleKernel kKernel;
}
#endif

std::vector<const LineBundleKernel*> AvailableLineBundleKernels() {
  std::vector<const LineBundleKernel*> kernels = {&kernel_baseline::kKernel};
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) kernels.push_back(&kernel_avx2::kKernel);
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl")) {
    kernels.push_back(&kernel_avx512::kKernel);
  }
#endif
  return kernels;
}

const LineBundleKernel& BestLineBundleKernel() { return *AvailableLineBundleKernels().back(); }

}  // namespace rigcal::server
