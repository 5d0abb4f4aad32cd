// SPDX-License-Identifier: Apache-2.0
// A stand-in for tests: of the SDK's header of this name, only what the agent uses.
#pragma once

#include <string>

namespace Metavision {

class DeviceConfig {
 public:
  std::string format() const { return format_; }
  void set_format(const std::string& format) { format_ = format; }

 private:
  std::string format_;
};

}  // namespace Metavision
