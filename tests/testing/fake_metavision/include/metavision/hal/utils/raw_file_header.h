// SPDX-License-Identifier: Apache-2.0
// A stand-in for tests: of the SDK's header of this name, only what the agent uses.
#pragma once

#include <map>
#include <string>

namespace Metavision {

class RawFileHeader {
 public:
  void set_field(const std::string& key, const std::string& value) { fields_[key] = value; }
  // Empty: there is none.
  std::string get_field(const std::string& key) const {
    const auto found = fields_.find(key);
    return found == fields_.end() ? "" : found->second;
  }

 private:
  std::map<std::string, std::string> fields_;
};

}  // namespace Metavision
