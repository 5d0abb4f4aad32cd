// SPDX-License-Identifier: Apache-2.0
#include "tests/common/file/failing_files.h"

#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

namespace rigcal::testing {

FileFaults file_faults;

}  // namespace rigcal::testing

extern "C" {

ssize_t write(int descriptor, const void* bytes, size_t size) {
  rigcal::testing::FileFaults& faults = rigcal::testing::file_faults;
  ++faults.writes;
  if (faults.interrupted_writes > 0) {
    --faults.interrupted_writes;
    errno = EINTR;
    return -1;
  }
  if (faults.most_per_write > 0) size = std::min(size, faults.most_per_write);
  return syscall(SYS_write, descriptor, bytes, size);
}

int fsync(int descriptor) {
  rigcal::testing::FileFaults& faults = rigcal::testing::file_faults;
  if (++faults.syncs == faults.failing_sync) {
    errno = faults.sync_error;
    return -1;
  }
  return static_cast<int>(syscall(SYS_fsync, descriptor));
}

}  // extern "C"
