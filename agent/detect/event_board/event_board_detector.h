// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/detect/board/board_detector.h"
#include "agent/event/any_event_decoder.h"
#include "common/board/board.h"

namespace rigcal::agent {

// What events show at one time, as a picture of dark discs on white, and the board in it.
struct EventBoardPicture {
  enum class Kind : uint8_t {
    kBurst = 1,  // of a screen that shows or hides its discs
    kFlicker,    // of pixels that flicker while others do not
    kMotion,     // of edges that moved
  };
  Kind kind = Kind::kBurst;
  double time_us = 0;  // the sensor's clock, overflows taken out
  uint32_t clock_epoch = 0;
  cv::Mat grey;  // CV_8UC1
  // Of all points at `time_us`: the centroids of the discs' images. None: there is no board.
  std::optional<SeenBoard> seen;
  // Of the board's points, median, by the pictures before and after; not a number where there is
  // none.
  double speed_px_s = 0;
};

struct EventBoardCounts {
  uint64_t events = 0;
  uint64_t bursts = 0;     // of a screen
  uint64_t too_quick = 0;  // changes that come sooner than a screen can blink: a lamp
  uint64_t pictures = 0;   // that were searched
  uint64_t boards = 0;     // found
  double blink_hz = 0;     // measured, shown and hidden together; 0: nothing blinks
  double flicker_hz = 0;   // between bursts: a backlight, a refresh, a lamp; 0: none
};

// Finds a board of circles in the events of one camera.
//
// On a screen that shows and hides its discs: each change is a burst (BurstFinder), whose picture
// is the net number of events at each pixel. A screen is drawn row by row, and its crystals take
// their time; but what is summed up shows all discs where they are at the end of a burst that shows
// them, or were at the beginning of one that hides them, and that is the picture's time.
//
// A print, or anything else that does not blink, in motion: PolarityFilter.
//
// A clock that steps back begins a new clock epoch. One thread at a time.
class EventBoardDetector {
 public:
  // `board` has circles.
  EventBoardDetector(const Board& board, SensorGeometry geometry, EventFormat format,
                     bool halves_swapped);
  EventBoardDetector(EventBoardDetector&&) noexcept;
  EventBoardDetector& operator=(EventBoardDetector&&) noexcept;
  ~EventBoardDetector();

  // Decodes whole words and appends pictures in order of time, some of them one picture late.
  absl::Status Take(std::span<const uint8_t> bytes, std::vector<EventBoardPicture>* pictures);
  // The stream has ended: appends what is still held back.
  absl::Status Finish(std::vector<EventBoardPicture>* pictures);

  const EventFaults& faults() const;
  EventBoardCounts counts() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rigcal::agent
