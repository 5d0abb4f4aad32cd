// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "agent/capture/detecting_observation_source.h"
#include "agent/capture/frame_source.h"
#include "agent/capture/source_kind.h"

namespace rigcal::agent {

// A source of frames, and how the wand is found in them.
class FrameSourceSpec : public SourceSpec {
 public:
  using Product = FrameSource;
  // The frames alone.
  virtual absl::StatusOr<std::unique_ptr<Product>> Make() const = 0;
  absl::StatusOr<std::unique_ptr<ObservationSource>> Create() const final;
  void AddDetector(OptionTable* table);

  DetectingOptions detecting;
};

}  // namespace rigcal::agent
