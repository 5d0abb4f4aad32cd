// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace rigcal::testing {

// write() and fsync() of this test program, which takes the place of the C library's.
struct FileFaults {
  size_t most_per_write = 0;   // bytes that one write takes; 0: all
  int interrupted_writes = 0;  // so many writes fail with EINTR first
  int failing_sync = 0;        // this one fails, counted from 1; 0: none
  int sync_error = 0;          // with this error
  int writes = 0;              // made so far
  int syncs = 0;
};
extern FileFaults file_faults;

}  // namespace rigcal::testing
