// SPDX-License-Identifier: Apache-2.0
#include "absl/strings/str_cat.h"
#include "agent/capture/frame_source_spec.h"
#include "agent/capture/genicam/aravis_frame_source.h"

namespace rigcal::agent {

void AddOptions(AravisSourceOptions* options, OptionTable* table) {
  AravisSourceOptions& o = *options;
  AddCalibration(&o.calibration_path, table);
  table->Add("pixel_format", &o.pixel_format, "NAME", "GenICam name, such as BayerRG8");
  table->Add("exposure", &o.exposure_s, {1e-6, 10, "s"}, "switches automatic exposure off");
  table->Add("gain", &o.gain_db, {-60, 100, "dB"}, "switches automatic gain off");
  table->Add("frame_rate", &o.frame_rate_hz, {1e-3, 1e5, "Hz"}, "of the camera or the trigger");
  table->Add("trigger", &o.trigger, "free|software|LINE",
             "software needs frame_rate; LINE is an input such as Line0");
  table->Add("ptp", &o.ptp, "IEEE 1588; an error if the camera does not support it");
  table->Add("latency", &o.latency_s, {-10, 10, "s"},
             "from the middle of the exposure to the timestamp");
  table->Add("buffers", &o.buffer_count, {3, 1000}, "frames between network and detector");
  table->Add("packet_size", &o.packet_size, {0, 65'535, "bytes"}, "at least 576; 0: negotiated");
  table->Add("packet_resend", &o.packet_resend, "ask again for missing packets");
  table->Add("socket_buffer", &o.socket_buffer_bytes, {65'536, 1 << 30, "bytes"},
             "of a GigE stream, in the kernel");
  table->Add("interface", &o.network_interface, "NAME", "search on this network only");
}

absl::Status AravisSourceOptions::Validate() const {
  FaultList faults;
  if (camera.empty()) faults.Add("the camera's name is empty");
  if (device.empty()) {
    faults.Add("the device is empty: give an Aravis id, a serial number or an address");
  }
  CheckOptions(*this, &faults);
  if (exposure_s && frame_rate_hz && *exposure_s * *frame_rate_hz > 1) {
    faults.Add("an exposure of ", *exposure_s, " s does not fit ", *frame_rate_hz,
               " frames a second");
  }
  if (trigger.empty()) {
    faults.Add("trigger is empty, but must be free, software or a line such as Line0");
  }
  if (trigger == "software" && !frame_rate_hz) {
    faults.Add("trigger=software needs frame_rate, at which the agent requests frames");
  }
  if (packet_size > 0 && packet_size < 576) faults.Add("packet_size must be 0 or at least 576");
  return faults.Result(absl::StrCat("camera ", camera, ": "));
}

void ResolveOptions(const std::string& name, const std::string& subject,
                    AravisSourceOptions* options) {
  options->device = subject;
  options->camera = name.empty() ? subject : name;
  ResolveCalibration("", &options->calibration_path);
}

extern constinit const SourceKind kAravisSource = {
    .name = "aravis",
    .subject = "DEVICE",
    .summary =
        "a GenICam camera (GigE Vision, USB3 Vision), by Aravis id, serial number or address",
    .example = "left=aravis:192.168.1.5;exposure=0.004",
    .make = MakeSpec<SpecOf<FrameSourceSpec, AravisFrameSource, AravisSourceOptions>>};

}  // namespace rigcal::agent
