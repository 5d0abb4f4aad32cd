// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/light_code_reader.h"

#include <spdlog/spdlog.h>

#include <cmath>
#include <utility>

#include "absl/strings/str_format.h"

namespace rigcal::agent {
namespace {

constexpr double kWrongRate =
    0.005;  // of a wand's clock: ten times what a ceramic resonator is off

}  // namespace

void LightCodeReader::Look(const std::string& camera, const Detection& detection) {
  const Observation& observation = detection.observation;
  if (clock_epoch_ != observation.clock_epoch) {
    decoder_ = LightCodeDecoder();
    clock_epoch_ = observation.clock_epoch;
  }
  if (!detection.light_level) return;
  decoder_.Add(observation.time_ns, *detection.light_level);
  for (const LightCodeReading& reading : decoder_.Take()) {
    Note(camera, reading);
    samples_.push_back(ToClockSample(reading));
  }
  if (decoder_.state() != LightCodeState::kTooSlow) return;
  const std::string what = absl::StrFormat(
      "the wand's brightness changes as that of a light code does, and %.3g frames a second are "
      "too "
      "few to read it: set %.3g frames a second or more",
      decoder_.frame_rate_hz(), LightCodeDecoder::kLeastRateHz);
  if (refused_.empty()) spdlog::warn("camera {}: {}", camera, what);
  refused_.Add("", RefusalReason::kLightCodeTooFast, 1, what);
}

void LightCodeReader::Note(const std::string& camera, const LightCodeReading& reading) {
  if (reading.wand != wand_) {
    spdlog::info("camera {}: reads the light code of wand {}, which has been on for {:.1f} s",
                 camera, reading.wand, 1e-9 * static_cast<double>(reading.wand_time_ns));
    wand_ = reading.wand;
  }
  const double off = reading.wand_rate - 1;
  if (std::abs(off) < kWrongRate || std::exchange(warned_of_rate_, true)) return;
  spdlog::warn(
      "camera {}: the clock of wand {} runs {:.1f} % {} by its light code, which is followed; look "
      "at its battery",
      camera, reading.wand, 100 * std::abs(off), off < 0 ? "slow" : "fast");
}

std::vector<ClockSample> LightCodeReader::Take() { return std::exchange(samples_, {}); }

}  // namespace rigcal::agent
