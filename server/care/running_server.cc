// SPDX-License-Identifier: Apache-2.0
#include "server/care/running_server.h"

#include <spdlog/spdlog.h>

#include <fstream>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"

namespace rigcal::server {
namespace {

constexpr char kAddressFile[] = "address";

}  // namespace

RunningServerNote::RunningServerNote(const std::filesystem::path& data_directory,
                                     const std::string& address)
    : file_(data_directory / kAddressFile) {
  const absl::Status written = WriteDurableFile(file_, address + "\n");
  if (!written.ok()) spdlog::warn("{}", std::string(written.message()));
}

RunningServerNote::~RunningServerNote() {
  std::error_code error;
  std::filesystem::remove(file_, error);
}

absl::StatusOr<std::string> AddressOfRunningServer(const std::filesystem::path& data_directory) {
  std::string address;
  std::ifstream(data_directory / kAddressFile) >> address;
  if (!address.empty()) return address;
  return absl::NotFoundError(absl::StrCat("the address of the server that uses ",
                                          data_directory.string(),
                                          " is not known; name it with --server"));
}

std::string LocalAddress(const std::string& listen, int port) {
  const size_t colon = listen.rfind(':');
  std::string host = listen.substr(0, colon == std::string::npos ? 0 : colon);
  if (host.empty() || host == "0.0.0.0") host = "127.0.0.1";
  if (host == "[::]") host = "[::1]";
  return absl::StrCat(host, ":", port);
}

}  // namespace rigcal::server
