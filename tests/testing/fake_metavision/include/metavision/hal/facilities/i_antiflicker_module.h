// SPDX-License-Identifier: Apache-2.0
// A stand-in for tests: of the SDK's header of this name, only what the agent uses.
#pragma once

#include "metavision/hal/facilities/i_registrable_facility.h"

namespace Metavision {

class I_AntiFlickerModule : public I_RegistrableFacility<I_AntiFlickerModule> {
 public:
  virtual bool enable(bool b) = 0;
};

}  // namespace Metavision
