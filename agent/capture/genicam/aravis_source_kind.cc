// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/frame_source_spec.h"
#include "agent/capture/genicam/aravis_frame_source.h"

namespace rigcal::agent {

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
