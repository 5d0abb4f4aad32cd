// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/event_source_spec.h"

#include <string>
#include <utility>
#include <vector>

#include "common/status/status_macros.h"

namespace rigcal::agent {

void EventSourceSpec::AddDetector(OptionTable* table) {
  table->AddChoice(
      "trigger", &detector.output.trigger,
      std::vector<std::pair<std::string, TriggerInstant>>{{"none", TriggerInstant::kNone},
                                                          {"rising", TriggerInstant::kRising},
                                                          {"falling", TriggerInstant::kFalling},
                                                          {"middle", TriggerInstant::kMiddle}},
      "also observe the wand at external triggers");
  table->Add("trigger_channel", &detector.output.trigger_channel, {-1, 31}, "-1: every one");
  table->Add("rate", &rate_hz_, {0, 1000, "Hz"},
             "observations at a fixed rate; 200 unless there is a trigger");
  table->Add("band", &detector.band_rel, {0.01, 0.45},
             "how far a period may be from the target's, as a share of it");
  table->Add("min_periods", &detector.min_periods, {1, 7}, "in a row, before a pixel is used");
  table->Add("min_blob", &detector.min_blob_pixels, {1, 100'000, "px"}, "that blink side by side");
  table->Add("min_distance", &detector.min_distance_m, {0, 1000, "m"}, "of every marker");
  table->Add("max_distance", &detector.max_distance_m, {0, 1000, "m"}, "of every marker");
  table->Add("max_tilt", &detector.max_tilt_deg, {10, 89, "deg"},
             "of the wand out of the image plane");
  table->Add("min_confidence", &detector.min_confidence, {0, 1}, "less is no wand");
}

absl::Status EventSourceSpec::CheckDetector() {
  const bool has_trigger = detector.output.trigger != TriggerInstant::kNone;
  detector.output.rate_hz = rate_hz_.value_or(has_trigger ? 0 : kDefaultRateHz);
  return detector.Validate();
}

absl::StatusOr<std::unique_ptr<ObservationSource>> EventSourceSpec::Create() const {
  RIGCAL_ASSIGN_OR_RETURN(auto events, Make());
  return std::make_unique<EventObservationSource>(std::move(events), detector);
}

}  // namespace rigcal::agent
