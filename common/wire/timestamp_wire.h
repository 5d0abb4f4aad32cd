// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <google/protobuf/timestamp.pb.h>

#include <cstdint>

namespace rigcal::wire {

// UTC nanoseconds since 1970 (after it), and back.
inline google::protobuf::Timestamp ToTimestamp(int64_t utc_ns) {
  google::protobuf::Timestamp timestamp;
  timestamp.set_seconds(utc_ns / 1'000'000'000);
  timestamp.set_nanos(static_cast<int32_t>(utc_ns % 1'000'000'000));
  return timestamp;
}
inline int64_t FromTimestamp(const google::protobuf::Timestamp& timestamp) {
  return timestamp.seconds() * 1'000'000'000 + timestamp.nanos();
}

}  // namespace rigcal::wire
