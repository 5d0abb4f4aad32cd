// SPDX-License-Identifier: Apache-2.0
// A stand-in for tests: of the SDK's header of this name, only what the agent uses.
#pragma once

#include <cstdint>

#include "metavision/hal/facilities/i_registrable_facility.h"

namespace Metavision {

class I_ErcModule : public I_RegistrableFacility<I_ErcModule> {
 public:
  virtual bool enable(bool b) = 0;
  virtual bool set_cd_event_rate(uint32_t events_per_sec) = 0;
#if FAKE_METAVISION_MAJOR >= 5
  virtual uint32_t get_min_supported_cd_event_rate() const = 0;
  virtual uint32_t get_max_supported_cd_event_rate() const = 0;
#else
  virtual uint32_t get_min_supported_cd_event_rate() = 0;
  virtual uint32_t get_max_supported_cd_event_rate() = 0;
#endif
};

}  // namespace Metavision
