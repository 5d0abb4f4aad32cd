// SPDX-License-Identifier: Apache-2.0
// A stand-in for tests: of the SDK's header of this name, only what the agent uses.
#pragma once

#include "metavision/hal/facilities/i_registrable_facility.h"

namespace Metavision {

class I_CameraSynchronization : public I_RegistrableFacility<I_CameraSynchronization> {
 public:
  virtual bool set_mode_standalone() = 0;
  virtual bool set_mode_master() = 0;
  virtual bool set_mode_slave() = 0;
};

}  // namespace Metavision
