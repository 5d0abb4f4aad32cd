// SPDX-License-Identifier: Apache-2.0
// A stand-in for tests: of the SDK's header of this name, only what the agent uses.
#pragma once

#include <string>
#include <system_error>

namespace Metavision {

using HalErrorCodeType = int;

// Its text is several lines between rulers.
class HalException : public std::system_error {
 public:
  HalException(HalErrorCodeType e, const std::string& additional_info);
  const char* what() const noexcept override { return text_.c_str(); }

 private:
  std::string text_;
};

}  // namespace Metavision
