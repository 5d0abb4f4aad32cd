// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ctime>

namespace rigcal::accuracy {

// CPU time of the calling thread so far.
inline double ThreadCpuS() {
  timespec time = {};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace rigcal::accuracy
