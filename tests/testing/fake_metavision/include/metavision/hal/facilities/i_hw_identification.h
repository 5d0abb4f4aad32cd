// SPDX-License-Identifier: Apache-2.0
// A stand-in for tests: of the SDK's header of this name, only what the agent uses.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "metavision/hal/facilities/i_registrable_facility.h"
#include "metavision/hal/utils/raw_file_header.h"

namespace Metavision {

class I_HW_Identification : public I_RegistrableFacility<I_HW_Identification> {
 public:
  struct SensorInfo {
    uint16_t major_version_ = 0;
    uint16_t minor_version_ = 0;
    std::string name_;
  };

  virtual std::string get_serial() const = 0;
  virtual SensorInfo get_sensor_info() const = 0;
  virtual std::vector<std::string> get_available_data_encoding_formats() const = 0;
  virtual std::string get_current_data_encoding_format() const = 0;
  virtual std::string get_integrator() const = 0;
  RawFileHeader get_header() const { return get_header_impl(); }

 private:
  virtual RawFileHeader get_header_impl() const = 0;
};

}  // namespace Metavision
