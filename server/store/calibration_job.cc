// SPDX-License-Identifier: Apache-2.0
#include "server/store/calibration_job.h"

#include "absl/strings/str_cat.h"

namespace rigcal::server {

std::string NameOf(const JobHolder& holder) {
  return absl::StrCat(holder.is_server ? "rigcal-server" : "rigcal-worker", " on ", holder.host,
                      " (process ", holder.pid, ")");
}

}  // namespace rigcal::server
