// SPDX-License-Identifier: Apache-2.0
// A stand-in for tests: of the SDK's header of this name, only what the agent uses.
#pragma once

#include <list>
#include <memory>
#include <string>

#include "metavision/hal/utils/device_config.h"

namespace Metavision {

class Device;

class DeviceDiscovery {
 public:
  using SerialList = std::list<std::string>;

  // "integrator:plugin:serial" of each.
  static SerialList list();
  // Empty: the first one. Null: there is none.
#if FAKE_METAVISION_MAJOR >= 5
  static std::unique_ptr<Device> open(const std::string& serial, const DeviceConfig& config);
#else
  static std::unique_ptr<Device> open(const std::string& serial, DeviceConfig& config);
#endif
};

}  // namespace Metavision
