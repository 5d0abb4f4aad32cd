// SPDX-License-Identifier: Apache-2.0
#include "absl/strings/str_cat.h"
#include "agent/capture/event_source_spec.h"
#include "agent/capture/frame_source_spec.h"
#include "agent/capture/simulated/simulated_event_source.h"
#include "agent/capture/simulated/simulated_frame_source.h"
#include "agent/capture/simulated/simulated_observation_source.h"

namespace rigcal::agent {

void ResolveOptions(const std::string& name, const std::string&, SimulatedCameraOptions* options) {
  options->camera = name.empty() ? absl::StrCat("sim_", options->camera_index) : name;
}

namespace {

// "rate" is the world's, so the detector has another name for its own, and no other options.
class SimulatedEventSpec
    : public SpecOf<EventSourceSpec, SimulatedEventSource, SimulatedEventSourceOptions> {
 public:
  void AddTo(OptionTable* table) override {
    AddOptions(&options, table);
    table->Add("output", &output_hz_, {10, 1000, "Hz"}, "observations at a fixed rate");
  }
  absl::Status Resolve(const std::string& name, const std::string& subject) override {
    absl::Status status = SpecOf::Resolve(name, subject);
    detector.output.rate_hz = output_hz_;
    return status;
  }

 private:
  double output_hz_ = kDefaultRateHz;
};

}  // namespace

extern constinit const SourceKind kSimulatedMarkersSource = {
    .name = "sim",
    .required = "camera",
    .summary = "a simulated camera: marker centres",
    .example = "sim:camera=0;seed=1;cameras=6;speed=max",
    .make = MakeSpec<SpecOf<DirectSourceSpec, SimulatedObservationSource, SimulatedCameraOptions>>};

extern constinit const SourceKind kSimulatedFramesSource = {
    .name = "sim",
    .selector = "pixels",
    .required = "camera",
    .summary = "a simulated camera: rendered frames",
    .example = "sim:camera=0;pixels=1;cameras=4;lux=50",
    .make = MakeSpec<SpecOf<FrameSourceSpec, SimulatedFrameSource, SimulatedFrameSourceOptions>>};

extern constinit const SourceKind kSimulatedEventsSource = {
    .name = "sim",
    .selector = "events",
    .required = "camera",
    .summary = "a simulated event camera",
    .example = "sim:camera=0;events=1;cameras=4;lux=300",
    .make = MakeSpec<SimulatedEventSpec>};

}  // namespace rigcal::agent
