// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <utility>

namespace rigcal {

// What the lines that a thread logs are about. Empty fields are left out.
struct LogFields {
  std::string session = {};
  std::string camera = {};
  std::string calibration = {};
  std::string correlation = {};  // see common/log/correlation_id.h

  // Of this thread.
  static const LogFields& Current();
};

// The lines of this thread are about `fields`, too, until this object's end; empty ones stay as
// they were. Ends on the thread where it began, the last one first.
class LogScope {
 public:
  explicit LogScope(const LogFields& fields);
  ~LogScope();
  LogScope(const LogScope&) = delete;
  LogScope& operator=(const LogScope&) = delete;

 private:
  LogFields before_;
};

}  // namespace rigcal
