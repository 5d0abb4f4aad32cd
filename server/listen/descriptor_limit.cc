// SPDX-License-Identifier: Apache-2.0
#include "server/listen/descriptor_limit.h"

#include <sys/resource.h>

#include <algorithm>

namespace rigcal::server {
namespace {

// Database, log files, threads' wake-up descriptors, and some to spare.
constexpr size_t kOtherDescriptors = 256;

}  // namespace

size_t RaiseDescriptorLimit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return 1024;
  if (limit.rlim_cur < limit.rlim_max) {
    rlimit raised = limit;
    raised.rlim_cur = limit.rlim_max;
    if (setrlimit(RLIMIT_NOFILE, &raised) == 0) limit = raised;
  }
  return limit.rlim_cur == RLIM_INFINITY ? size_t{1} << 20 : static_cast<size_t>(limit.rlim_cur);
}

size_t ConnectionsWithin(size_t descriptor_limit, size_t wanted) {
  const size_t others = std::min(kOtherDescriptors, descriptor_limit / 2);
  return std::clamp<size_t>((descriptor_limit - others) / 2, 1, std::max<size_t>(wanted, 1));
}

}  // namespace rigcal::server
