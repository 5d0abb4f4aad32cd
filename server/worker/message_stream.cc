// SPDX-License-Identifier: Apache-2.0
#include "server/worker/message_stream.h"

#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "absl/strings/str_cat.h"

namespace rigcal::server {
namespace {

constexpr size_t kLengthBytes = 4;
constexpr size_t kWriteBytes = size_t{1} << 18;

}  // namespace

absl::Status MessageWriter::Write(const google::protobuf::MessageLite& message) {
  const size_t size = message.ByteSizeLong();
  if (size > kMaxWorkerMessageBytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat("a message of ", size, " bytes is too large for the worker"));
  }
  for (size_t i = 0; i < kLengthBytes; ++i) {
    buffer_.push_back(static_cast<char>(size >> (8 * i) & 0xff));
  }
  message.AppendToString(&buffer_);
  return buffer_.size() < kWriteBytes ? absl::OkStatus() : Flush();
}

absl::Status MessageWriter::Flush() {
  size_t begin = 0;
  while (begin < buffer_.size()) {
    const ssize_t written = write(descriptor_, buffer_.data() + begin, buffer_.size() - begin);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) {
      const std::string why = strerror(errno);
      return errno == ENOSPC || errno == EDQUOT ? absl::ResourceExhaustedError(why)
                                                : absl::UnavailableError(why);
    }
    begin += static_cast<size_t>(written);
  }
  buffer_.clear();
  return absl::OkStatus();
}

absl::StatusOr<bool> MessageCutter::Next(google::protobuf::MessageLite* message) {
  const size_t available = buffer_.size() - begin_;
  size_t size = 0;
  if (available >= kLengthBytes) {
    for (size_t i = 0; i < kLengthBytes; ++i) {
      size |= size_t{static_cast<unsigned char>(buffer_[begin_ + i])} << (8 * i);
    }
    if (size > kMaxWorkerMessageBytes) {
      return absl::DataLossError(absl::StrCat("a message claims ", size, " bytes"));
    }
  }
  if (available < kLengthBytes || available - kLengthBytes < size) {
    // What has been read goes before more is added.
    buffer_.erase(0, begin_);
    begin_ = 0;
    return false;
  }
  if (!message->ParseFromArray(buffer_.data() + begin_ + kLengthBytes, static_cast<int>(size))) {
    return absl::DataLossError("a message cannot be read");
  }
  begin_ += kLengthBytes + size;
  return true;
}

}  // namespace rigcal::server
