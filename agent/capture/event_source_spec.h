// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include "agent/capture/event_observation_source.h"
#include "agent/capture/source_kind.h"
#include "agent/event/event_source.h"

namespace rigcal::agent {

// A source of events, and how the wand is found in them.
class EventSourceSpec : public SourceSpec {
 public:
  using Product = EventSource;
  // The events alone.
  virtual absl::StatusOr<std::unique_ptr<Product>> Make() const = 0;
  absl::StatusOr<std::unique_ptr<ObservationSource>> Create() const final;
  void AddDetector(OptionTable* table);

  BlinkWandDetectorOptions detector;

 protected:
  static constexpr double kDefaultRateHz = 200;

  absl::Status CheckDetector();

 private:
  std::optional<double> rate_hz_;
};

}  // namespace rigcal::agent
