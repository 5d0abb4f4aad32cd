// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/aravis_options.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace rigcal::agent {
namespace {

// Written so that NaN is a fault.
template <typename T>
void CheckRange(const char* what, T value, T lowest, T highest, const char* unit,
                std::vector<std::string>* faults) {
  if (value >= lowest && value <= highest) return;
  faults->push_back(
      absl::StrCat(what, " is ", value, unit, ", but must be ", lowest, " to ", highest, unit));
}

}  // namespace

absl::Status AravisSourceOptions::Validate() const {
  std::vector<std::string> faults;
  if (camera.empty()) faults.push_back("the camera's name is empty");
  if (device.empty()) {
    faults.push_back("the device is empty: give Aravis' id, a serial number or an address");
  }
  if (exposure_s) CheckRange("exposure", *exposure_s, 1e-6, 10.0, " s", &faults);
  if (gain_db) CheckRange("gain", *gain_db, -60.0, 100.0, " dB", &faults);
  if (frame_rate_hz) CheckRange("frame rate", *frame_rate_hz, 1e-3, 1e5, " Hz", &faults);
  if (exposure_s && frame_rate_hz && *exposure_s * *frame_rate_hz > 1) {
    faults.push_back(absl::StrCat("an exposure of ", *exposure_s, " s does not fit ",
                                  *frame_rate_hz, " pictures a second"));
  }
  if (trigger.empty()) {
    faults.push_back("trigger is empty, but must be free, software or a line such as Line0");
  }
  if (trigger == "software" && !frame_rate_hz) {
    faults.push_back("trigger=software needs a frame rate: the agent asks for pictures at it");
  }
  CheckRange("buffer count", buffer_count, 3, 1000, "", &faults);
  if (packet_size != 0) CheckRange("packet size", packet_size, 576, 65'535, " bytes", &faults);
  CheckRange("socket buffer", socket_buffer_bytes, 65'536, 1 << 30, " bytes", &faults);
  CheckRange("blink frequency", blink_hz, 0.0, 1e6, " Hz", &faults);
  CheckRange("latency", latency_s, -10.0, 10.0, " s", &faults);
  if (faults.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("camera ", camera, ": ", absl::StrJoin(faults, "; ")));
}

}  // namespace rigcal::agent
