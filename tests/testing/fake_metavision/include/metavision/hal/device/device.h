// SPDX-License-Identifier: Apache-2.0
// A stand-in for tests: of the SDK's header of this name, only what the agent uses.
#pragma once

#include <map>
#include <memory>
#include <typeindex>
#include <typeinfo>

#include "metavision/hal/facilities/i_registrable_facility.h"

namespace Metavision {

class Device {
 public:
  using Facilities = std::map<std::type_index, std::shared_ptr<I_Facility>>;

  explicit Device(Facilities facilities) : facilities_(std::move(facilities)) {}

  template <typename FacilityType>
  FacilityType* get_facility() {
    const auto found = facilities_.find(typeid(FacilityType));
    return found == facilities_.end() ? nullptr : dynamic_cast<FacilityType*>(found->second.get());
  }

 private:
  Facilities facilities_;
};

}  // namespace Metavision
