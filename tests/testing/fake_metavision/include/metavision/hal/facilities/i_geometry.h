// SPDX-License-Identifier: Apache-2.0
// A stand-in for tests: of the SDK's header of this name, only what the agent uses.
#pragma once

#include "metavision/hal/facilities/i_registrable_facility.h"

namespace Metavision {

class I_Geometry : public I_RegistrableFacility<I_Geometry> {
 public:
  virtual int get_width() const = 0;
  virtual int get_height() const = 0;
};

}  // namespace Metavision
