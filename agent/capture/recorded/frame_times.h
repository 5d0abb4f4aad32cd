// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "common/status/refusal.h"

namespace rigcal::agent {

// Natural order of names: runs of digits by their value, so "f_9" comes before "f_10"; everything
// else byte by byte. A strict order: names that differ only in leading zeros compare by bytes.
bool NaturallyBefore(std::string_view a, std::string_view b);

// The time in an image's name: the last run of at least ten digits, in nanoseconds, as in
// "frame_000123_1699999999123456789.png" or "0000000040000000.png". Shorter numbers count images
// and are not times. None: there is no such run, or it is beyond 64 bits.
std::optional<int64_t> TimeFromName(std::string_view name);

// Times from a file beside the images. Lines are `name;timestamp_ns` for named images, or
// `timestamp_ns` for the first, second, ... frame of a video; a first line of words is a heading,
// blank lines and those beginning with '#' are left out. What cannot be read is counted as
// timestamp_bad_line, a name that is there again as timestamp_duplicate (the first one counts).
struct FrameTimes {
  bool is_there = false;  // a file of times
  std::map<std::string, int64_t, std::less<>> by_name;
  std::vector<std::optional<int64_t>> by_number;  // none: a line that could not be read
  RefusalCounter refused;
};
// NOT_FOUND, PERMISSION_DENIED, ...: naming the file.
absl::StatusOr<FrameTimes> ReadImageTimes(const std::string& path);

// The median difference between successive times, ns; 0 for fewer than two.
int64_t MedianStepNs(const std::vector<int64_t>& times_ns);

}  // namespace rigcal::agent
