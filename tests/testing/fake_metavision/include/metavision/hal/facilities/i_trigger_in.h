// SPDX-License-Identifier: Apache-2.0
// A stand-in for tests: of the SDK's header of this name, only what the agent uses.
#pragma once

#include <map>

#include "metavision/hal/facilities/i_registrable_facility.h"

namespace Metavision {

class I_TriggerIn : public I_RegistrableFacility<I_TriggerIn> {
 public:
  enum class Channel { Main, Aux, Loopback };

  virtual bool enable(const Channel& channel) = 0;
  // With the number that each has in the stream.
  virtual std::map<Channel, short> get_available_channels() const = 0;
};

}  // namespace Metavision
