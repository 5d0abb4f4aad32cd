// SPDX-License-Identifier: Apache-2.0
// A stand-in for tests: of the SDK's header of this name, only what the agent uses.
#pragma once

namespace Metavision {

class I_Facility {
 public:
  virtual ~I_Facility() = default;
};

template <typename SelfType>
class I_RegistrableFacility : public I_Facility {};

}  // namespace Metavision
