// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace rigcal::client {

// What there is on a server, each newest first.
struct KnownIds {
  std::vector<std::string> sessions;
  std::vector<std::string> calibrations;
};

// The kind and id that the server's message "no session wave" or "no calibration c-1" speaks of;
// an empty kind for every other message.
struct UnknownId {
  std::string kind;  // "session" or "calibration"
  std::string id;
};
UnknownId ParseUnknownId(const std::string& message);

// What was probably meant, or what there is: "no session wav; did you mean wave?".
std::string DescribeUnknownId(const UnknownId& unknown, const KnownIds& known);

}  // namespace rigcal::client
