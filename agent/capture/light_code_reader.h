// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "agent/detect/light_code/light_code_decoder.h"
#include "agent/identify/detection.h"
#include "common/status/refusal.h"
#include "common/time/clock.h"

namespace rigcal::agent {

// Reads the light code of the wand in a camera's detections, and says in the log which wand it is,
// that its clock is wrong, or that the camera is too slow. One thread at a time.
class LightCodeReader {
 public:
  // The next detection, in capture order.
  void Look(const std::string& camera, const Detection& detection);
  // What was read since the last call.
  std::vector<ClockSample> Take();
  // Frames that showed a code too fast for the camera.
  void AddRefused(RefusalCounter* refused) const {
    for (const Refusal& refusal : refused_.List()) refused->Add(refusal);
  }
  // A capture begins.
  void Clear() { *this = LightCodeReader(); }

 private:
  void Note(const std::string& camera, const LightCodeReading& reading);

  LightCodeDecoder decoder_;
  std::optional<uint32_t> clock_epoch_;
  std::vector<ClockSample> samples_;
  uint32_t wand_ = 0;  // read last
  bool warned_of_rate_ = false;
  RefusalCounter refused_;
};

}  // namespace rigcal::agent
