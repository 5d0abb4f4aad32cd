// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "absl/status/status.h"
#include "google/protobuf/descriptor.h"
#include "google/protobuf/io/zero_copy_stream.h"

namespace rigcal::wire {

// The most that a field of a request may hold: elements of a repeated field, bytes of a string.
struct FieldLimit {
  const char* field;   // full name
  uint32_t count = 0;  // 0: not repeated
  uint32_t bytes = 0;  // 0: neither string nor bytes
};

// The limits of every repeated, string and bytes field that a request can have, in one table.
std::span<const FieldLimit> FieldLimits();

// True for messages that a server receives.
bool IsRequest(const google::protobuf::Descriptor& type);

// Reads the bytes of a request without making a message of them, and checks them against the
// limits: a few MiB of bytes can make hundreds of MiB of message. INVALID_ARGUMENT begins with the
// path of the field ("batch.clock_samples: ..."), also for bytes that are no message, and for a
// part that comes twice.
absl::Status ScanRequest(const google::protobuf::Descriptor& type,
                         google::protobuf::io::ZeroCopyInputStream* bytes);

}  // namespace rigcal::wire
