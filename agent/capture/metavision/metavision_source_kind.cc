// SPDX-License-Identifier: Apache-2.0
#include "absl/strings/str_cat.h"
#include "agent/capture/event_source_spec.h"
#include "agent/capture/metavision/metavision_event_source.h"

namespace rigcal::agent {

void AddOptions(MetavisionSourceOptions* options, OptionTable* table) {
  MetavisionSourceOptions& o = *options;
  table->Add("serial", &o.serial, "NUMBER", "needed if there are several cameras");
  table->AddPath("biases", &o.settings_path, "TOML with biases, trigger inputs, event rate limit");
  table->AddChoice("sync", &o.sync, EventCameraSyncNames(), "role on a sync cable");
  table->Add("primary_delay", &o.primary_delay_s, {0, 60, "s"},
             "by which a primary starts after the others");
  table->Add("clock", &o.clock_id, "NAME", "shared by sensors on one sync cable");
  AddCalibration(&o.calibration_path, table);
  table->Add("latency", &o.latency_s, {-10, 10, "s"}, "from an event to its timestamp");
}

absl::Status MetavisionSourceOptions::Validate() const {
  FaultList faults;
  if (camera.empty()) faults.Add("the camera's name is empty");
  CheckOptions(*this, &faults);
  if (trigger_channel != -1) faults.CheckRange("trigger_channel", trigger_channel, 0, 31);
  if (shortest_pause.count() < 1 || longest_pause < shortest_pause) {
    faults.Add("the shortest pause must be above 0 and not longer than the longest");
  }
  return faults.Result(absl::StrCat("camera ", camera, ": "));
}

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

extern constinit const SourceKind kMetavisionSource = {
    .name = "metavision",
    .summary = "a live event camera; needs an agent built with RIGCAL_METAVISION",
    .example = "left=metavision:serial=00050423;biases=biases.toml;rate=200",
    .make = MakeSpec<MetavisionSpec>};

}  // namespace rigcal::agent
