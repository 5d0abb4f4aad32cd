// SPDX-License-Identifier: Apache-2.0
// aravis:
#include <string>
#include <utility>

#include "agent/capture/source_kinds.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {

absl::StatusOr<SourceSpec> ParseAravisSource(SourceText text) {
  AravisSourceOptions options;
  options.device = text.subject;
  options.camera = text.name.empty() ? text.subject : text.name;
  SourceOptions& given = text.options;
  given.Take("calibration", &options.calibration_path);
  if (options.calibration_path == "none") options.calibration_path.clear();
  given.Take("pixel_format", &options.pixel_format);
  given.Take("exposure", "a time of 1e-6 to 10 s", 1e-6, 10.0, &options.exposure_s);
  given.Take("gain", "a gain of -60 to 100 dB", -60.0, 100.0, &options.gain_db);
  given.Take("frame_rate", "a rate above 0, at most 100000 Hz", 1e-6, 1e5, &options.frame_rate_hz);
  given.Take("trigger", &options.trigger);
  given.Take("ptp", &options.ptp);
  given.Take("latency", "a time of -10 to 10 s", -10.0, 10.0, &options.latency_s);
  given.Take("buffers", "a number of pictures, 3 to 1000", 3, 1000, &options.buffer_count);
  given.Take("packet_size", "a number of bytes, 576 to 65535, or 0", 0, 65535,
             &options.packet_size);
  given.Take("packet_resend", &options.packet_resend);
  given.Take("socket_buffer", "a number of bytes, 65536 to 1073741824", 1 << 16, 1 << 30,
             &options.socket_buffer_bytes);
  given.Take("interface", &options.network_interface);
  FrameSourceSpec spec;
  TakeDetectingOptions(&given, &spec.detecting);
  RIGCAL_RETURN_IF_ERROR(given.Finish());
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  spec.frames = std::move(options);
  return spec;
}

}  // namespace rigcal::agent
