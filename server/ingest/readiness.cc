// SPDX-License-Identifier: Apache-2.0
#include "server/ingest/readiness.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "absl/strings/str_cat.h"

namespace rigcal::server {

absl::Status Readiness(const std::string& data_dir, const StoreHealth& store,
                       const IngestStats& ingest) {
  std::string problem = store.problem;
  if (problem.empty()) problem = store.read_problem;
  if (problem.empty()) problem = ingest.problem;
  if (problem.empty() && access(data_dir.c_str(), W_OK) != 0) {
    problem = absl::StrCat("the data folder ", data_dir, " cannot be written: ", strerror(errno));
  }
  const bool disk_known = store.free_bytes > 0 || store.reserve_bytes > 0;
  if (problem.empty() && disk_known && store.room_bytes() < store.reserve_bytes) {
    problem = absl::StrCat("the disk has ", store.room_bytes() >> 20, " MiB left, and ",
                           store.reserve_bytes >> 20,
                           " MiB are its reserve; free space, or delete sessions");
  }
  return problem.empty() ? absl::OkStatus() : absl::UnavailableError(problem);
}

}  // namespace rigcal::server
