// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "google/protobuf/message_lite.h"

namespace rigcal::server {

// Messages one after the other, each behind its length (32 bit, little-endian).
inline constexpr size_t kMaxWorkerMessageBytes = size_t{256} << 20;

// Writes to a descriptor that it does not own. Collects small messages; the last ones are written
// by Flush.
class MessageWriter {
 public:
  explicit MessageWriter(int descriptor) : descriptor_(descriptor) {}

  // RESOURCE_EXHAUSTED: the disk is full. UNAVAILABLE: any other error of the system.
  absl::Status Write(const google::protobuf::MessageLite& message);
  absl::Status Flush();

 private:
  const int descriptor_;
  std::string buffer_;
};

// Takes bytes as they come and gives the messages in them.
class MessageCutter {
 public:
  void Add(const char* bytes, size_t count) { buffer_.append(bytes, count); }
  // False: the next message is not complete yet. DATA_LOSS: it cannot be one.
  absl::StatusOr<bool> Next(google::protobuf::MessageLite* message);
  bool empty() const { return begin_ == buffer_.size(); }

 private:
  std::string buffer_;
  size_t begin_ = 0;
};

}  // namespace rigcal::server
