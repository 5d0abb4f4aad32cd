// SPDX-License-Identifier: Apache-2.0
#include "server/worker/message_reader.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

constexpr size_t kReadBytes = size_t{1} << 18;

}  // namespace

absl::Status ReadMessages(int descriptor, google::protobuf::MessageLite* message,
                          const std::function<absl::Status()>& take) {
  MessageCutter cutter;
  std::string bytes(kReadBytes, '\0');
  while (true) {
    const ssize_t count = read(descriptor, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) {
      return absl::UnavailableError(
          absl::StrCat("the worker's input cannot be read: ", strerror(errno)));
    }
    if (count == 0) break;
    cutter.Add(bytes.data(), static_cast<size_t>(count));
    while (true) {
      RIGCAL_ASSIGN_OR_RETURN(const bool complete, cutter.Next(message));
      if (!complete) break;
      RIGCAL_RETURN_IF_ERROR(take());
    }
  }
  if (!cutter.empty())
    return absl::DataLossError("the worker's input is damaged: it ends within a message");
  return absl::OkStatus();
}

}  // namespace rigcal::server
