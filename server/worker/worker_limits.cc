// SPDX-License-Identifier: Apache-2.0
#include "server/worker/worker_limits.h"

#include <fcntl.h>
#include <malloc.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "absl/strings/str_cat.h"

namespace rigcal::server {
namespace {

constexpr int kNice = 10;
constexpr int kOomScore = 800;  // of 1000
// Blocks above this go back to the system as soon as they are freed.
constexpr int kMappedBlockBytes = 1 << 20;

absl::Status Refused(absl::string_view what) {
  return absl::FailedPreconditionError(absl::StrCat(what, ": ", strerror(errno)));
}

uint64_t VirtualBytes() {
  std::ifstream file("/proc/self/statm");
  uint64_t pages = 0;
  file >> pages;
  return pages * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

}  // namespace

absl::Status ApplyWorkerLimits(pid_t parent, uint64_t memory_bytes) {
  close_range(STDERR_FILENO + 1, ~0U, 0);
  if (parent != 0) {
    if (prctl(PR_SET_PDEATHSIG, SIGKILL) != 0) return Refused("cannot follow the server's end");
    // It may have ended before the line above.
    if (getppid() != parent) return absl::FailedPreconditionError("the server has gone");
  }
  setpriority(PRIO_PROCESS, 0, kNice);
  std::ofstream("/proc/self/oom_score_adj") << kOomScore << std::flush;
  mallopt(M_MMAP_THRESHOLD, kMappedBlockBytes);
  mallopt(M_TRIM_THRESHOLD, kMappedBlockBytes);
  mallopt(M_ARENA_MAX, 1);
  if (memory_bytes == 0) return absl::OkStatus();
  const rlimit limit = {.rlim_cur = VirtualBytes() + memory_bytes,
                        .rlim_max = VirtualBytes() + memory_bytes};
  if (setrlimit(RLIMIT_AS, &limit) != 0) return Refused("cannot limit the memory");
  return absl::OkStatus();
}

}  // namespace rigcal::server
