// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <google/protobuf/duration.pb.h>
#include <google/protobuf/timestamp.pb.h>
#include <google/protobuf/util/time_util.h>

#include <cstdint>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace rigcal::wire {

// UTC nanoseconds since 1970 (after it), and back.
inline google::protobuf::Timestamp ToTimestamp(int64_t utc_ns) {
  return google::protobuf::util::TimeUtil::NanosecondsToTimestamp(utc_ns);
}
inline int64_t FromTimestamp(const google::protobuf::Timestamp& timestamp) {
  return google::protobuf::util::TimeUtil::TimestampToNanoseconds(timestamp);
}

// `seconds` must be within +-1e9; rounded to the nearest nanosecond.
google::protobuf::Duration ToDuration(double seconds);
inline double SecondsOf(const google::protobuf::Duration& duration) {
  return static_cast<double>(duration.seconds()) + 1e-9 * duration.nanos();
}
// Whole milliseconds, rounded up. INVALID_ARGUMENT, beginning with `field`: not a valid duration,
// negative, or longer than 2^32 - 1 ms.
absl::StatusOr<uint32_t> MillisecondsOf(const google::protobuf::Duration& duration,
                                        absl::string_view field);
// INVALID_ARGUMENT, beginning with `field`: seconds and nanos are not a valid duration (range, or
// different signs).
absl::Status CheckDuration(const google::protobuf::Duration& duration, absl::string_view field);

}  // namespace rigcal::wire
