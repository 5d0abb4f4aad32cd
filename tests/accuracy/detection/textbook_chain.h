// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "agent/event/event_words.h"
#include "agent/event/evt3_writer.h"

namespace rigcal::accuracy {

// The chain that the eWand paper describes, to compare with: the textbook blink filter, an image of
// the pixels in the band, and OpenCV's blob detector (tests/testing/textbook_events.h).
class TextbookChain {
 public:
  TextbookChain(agent::SensorGeometry geometry, double blink_hz, double band_rel);
  ~TextbookChain();

  void Take(std::span<const agent::CdEvent> events);
  std::vector<Eigen::Vector2d> BlobsPx(int64_t time_us) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rigcal::accuracy
