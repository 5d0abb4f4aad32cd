// SPDX-License-Identifier: Apache-2.0
#include <string>

#include "agent/capture/event_source_spec.h"
#include "agent/capture/metavision/metavision_event_source.h"

namespace rigcal::agent {

void ResolveOptions(const std::string& name, const std::string&, MetavisionSourceOptions* options) {
  // The last part of "integrator:plugin:serial".
  const std::string& serial = options->serial;
  const std::string last = serial.substr(serial.rfind(':') + 1);  // npos + 1 is 0
  options->camera = !name.empty() ? name : last.empty() ? "metavision" : last;
  ResolveCalibration("", &options->calibration_path);
}

namespace {

class MetavisionSpec
    : public SpecOf<EventSourceSpec, MetavisionEventSource, MetavisionSourceOptions> {
 public:
  absl::Status Resolve(const std::string& name, const std::string& subject) override {
    options.uses_triggers = detector.output.trigger != TriggerInstant::kNone;
    options.trigger_channel = detector.output.trigger_channel;
    return SpecOf::Resolve(name, subject);
  }
};

}  // namespace

extern const SourceKind kMetavisionSource;
constinit const SourceKind kMetavisionSource = {
    .name = "metavision",
    .selector = "",
    .subject = "",
    .subject_is_path = false,
    .required = "",
    .summary = "a live event camera; needs an agent built with RIGCAL_METAVISION",
    .example = "left=metavision:serial=00050423;biases=biases.toml;rate=200",
    .make = MakeSpec<MetavisionSpec>};

}  // namespace rigcal::agent
