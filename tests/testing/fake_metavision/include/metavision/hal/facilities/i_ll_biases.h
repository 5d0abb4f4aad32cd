// SPDX-License-Identifier: Apache-2.0
// A stand-in for tests: of the SDK's header of this name, only what the agent uses.
#pragma once

#include <map>
#include <string>
#include <utility>

#include "metavision/hal/facilities/i_registrable_facility.h"

namespace Metavision {

class LL_Bias_Info {
 public:
  LL_Bias_Info() = default;
  LL_Bias_Info(int min_value, int max_value, bool modifiable)
      : range_(min_value, max_value), modifiable_(modifiable) {}

  std::pair<int, int> get_bias_range() const { return range_; }
  bool is_modifiable() const { return modifiable_; }

 private:
  std::pair<int, int> range_;
  bool modifiable_ = false;
};

// Throws HalException where a bias is not known, is not to be changed, or a value is out of range.
class I_LL_Biases : public I_RegistrableFacility<I_LL_Biases> {
 public:
  virtual bool set(const std::string& bias_name, int bias_value) = 0;
  virtual int get(const std::string& bias_name) = 0;
  virtual bool get_bias_info(const std::string& bias_name, LL_Bias_Info& bias_info) const = 0;
  virtual std::map<std::string, int> get_all_biases() = 0;
};

}  // namespace Metavision
