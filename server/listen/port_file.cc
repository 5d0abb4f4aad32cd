// SPDX-License-Identifier: Apache-2.0
#include "server/listen/port_file.h"

#include <cstdio>
#include <fstream>

namespace rigcal::server {

absl::Status WritePortFile(const std::string& path, int port) {
  const std::string temporary = path + ".new";
  std::ofstream file(temporary, std::ios::trunc);
  file << port << "\n";
  file.close();
  if (!file || std::rename(temporary.c_str(), path.c_str()) != 0) {
    return absl::UnavailableError("cannot write the port file " + path);
  }
  return absl::OkStatus();
}

}  // namespace rigcal::server
