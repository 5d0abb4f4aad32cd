// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/event_source_spec.h"
#include "agent/capture/recorded/raw_event_source.h"
#include "agent/event_files/sensor_geometry.h"

namespace rigcal::agent {
void AddOptions(RawSourceOptions* options, OptionTable* table) {
  AddSpeed(&options->speed, table);
  AddCalibration(&options->calibration_path, table);
  AddGeometry(&options->geometry, table);
  table->Add("clock", &options->clock_id, "NAME", "shared by sensors on one sync cable");
  AddOptions(&options->plain, table);
}

void ResolveOptions(const std::string& name, const std::string& subject,
                    RawSourceOptions* options) {
  options->path = subject;
  options->camera = CameraNameOf(name, subject);
  ResolveCalibration(subject, &options->calibration_path);
}

extern const SourceKind kRawSource;
constinit const SourceKind kRawSource = {
    .name = "raw",
    .selector = "",
    .subject = "FILE",
    .subject_is_path = true,
    .required = "",
    .summary = "recorded events: RAW (EVT 2.0, 2.1, 3.0), HDF5 or CSV",
    .example = "left=raw:rig/left.raw;rate=200;trigger=rising",
    .make = MakeSpec<SpecOf<EventSourceSpec, RawEventSource, RawSourceOptions>>};

}  // namespace rigcal::agent
