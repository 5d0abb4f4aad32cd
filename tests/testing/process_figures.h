// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

namespace rigcal::testing {

// Sanitizers take several times the memory: limits say nothing then.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kMemoryIsSanitized = true;
#else
inline constexpr bool kMemoryIsSanitized = false;
#endif

// Of a running process, from /proc; 0 when it has ended.
double MemoryMb(pid_t pid);      // resident now
double PeakMemoryMb(pid_t pid);  // the most that was resident
int OpenDescriptors(pid_t pid);
double CpuSeconds(pid_t pid);  // user and system time of all its threads

}  // namespace rigcal::testing
