// SPDX-License-Identifier: Apache-2.0
#include "common/wire/time_wire.h"

#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::wire {

google::protobuf::Duration ToDuration(double seconds) {
  return google::protobuf::util::TimeUtil::NanosecondsToDuration(std::llround(seconds * 1e9));
}

absl::Status CheckDuration(const google::protobuf::Duration& duration, absl::string_view field) {
  constexpr int64_t kMaxSeconds = 315'576'000'000;  // of google.protobuf.Duration
  constexpr int32_t kMaxNanos = 999'999'999;
  const bool in_range = duration.seconds() >= -kMaxSeconds && duration.seconds() <= kMaxSeconds &&
                        duration.nanos() >= -kMaxNanos && duration.nanos() <= kMaxNanos;
  const bool one_sign = (duration.seconds() >= 0 && duration.nanos() >= 0) ||
                        (duration.seconds() <= 0 && duration.nanos() <= 0);
  if (in_range && one_sign) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(field, ": ", duration.seconds(), " s and ",
                                                 duration.nanos(), " ns are not a valid duration"));
}

absl::StatusOr<uint32_t> MillisecondsOf(const google::protobuf::Duration& duration,
                                        absl::string_view field) {
  RIGCAL_RETURN_IF_ERROR(CheckDuration(duration, field));
  constexpr int64_t kMost = std::numeric_limits<uint32_t>::max();
  if (duration.seconds() < 0 || duration.nanos() < 0 || duration.seconds() > kMost / 1000 - 1) {
    return absl::InvalidArgumentError(
        absl::StrCat(field, ": ", SecondsOf(duration), " s is not within 0 to ", kMost / 1000 - 1));
  }
  return static_cast<uint32_t>(duration.seconds() * 1000 +
                               (duration.nanos() + 999'999) / 1'000'000);
}

}  // namespace rigcal::wire
