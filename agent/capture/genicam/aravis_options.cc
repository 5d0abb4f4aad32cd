// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/aravis_options.h"

#include "absl/strings/str_cat.h"
#include "common/status/fault_list.h"

namespace rigcal::agent {

absl::Status AravisSourceOptions::Validate() const {
  FaultList faults;
  if (camera.empty()) faults.Add("the camera's name is empty");
  if (device.empty()) {
    faults.Add("the device is empty: give Aravis' id, a serial number or an address");
  }
  if (exposure_s) faults.CheckRange("exposure", *exposure_s, 1e-6, 10.0, " s");
  if (gain_db) faults.CheckRange("gain", *gain_db, -60.0, 100.0, " dB");
  if (frame_rate_hz) faults.CheckRange("frame rate", *frame_rate_hz, 1e-3, 1e5, " Hz");
  if (exposure_s && frame_rate_hz && *exposure_s * *frame_rate_hz > 1) {
    faults.Add("an exposure of ", *exposure_s, " s does not fit ", *frame_rate_hz,
               " pictures a second");
  }
  if (trigger.empty()) {
    faults.Add("trigger is empty, but must be free, software or a line such as Line0");
  }
  if (trigger == "software" && !frame_rate_hz) {
    faults.Add("trigger=software needs a frame rate: the agent asks for pictures at it");
  }
  faults.CheckRange("buffer count", buffer_count, 3, 1000);
  if (packet_size != 0) faults.CheckRange("packet size", packet_size, 576, 65'535, " bytes");
  faults.CheckRange("socket buffer", socket_buffer_bytes, 65'536, 1 << 30, " bytes");
  faults.CheckRange("blink frequency", blink_hz, 0.0, 1e6, " Hz");
  faults.CheckRange("latency", latency_s, -10.0, 10.0, " s");
  return faults.Result(absl::StrCat("camera ", camera, ": "));
}

}  // namespace rigcal::agent
