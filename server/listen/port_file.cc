// SPDX-License-Identifier: Apache-2.0
#include "server/listen/port_file.h"

#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"

namespace rigcal::server {

absl::Status WritePortFile(const std::string& path, int port) {
  const absl::Status written = WriteOutputFile(path, absl::StrCat(port, "\n"));
  if (written.ok()) return absl::OkStatus();
  return absl::UnavailableError(
      absl::StrCat("the port file is not written: ", std::string(written.message())));
}

}  // namespace rigcal::server
