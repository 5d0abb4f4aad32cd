// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "common/light_code/light_code.h"
#include "common/simulation/frames/frame_render_options.h"
#include "common/target/target.h"

namespace rigcal {

// The light code that an LED of a simulated wand sends; a default one: none.
struct SentCode {
  const LightCode* code = nullptr;
  double on_s = 0;  // for which the wand had been on at time 0 of its clock

  // Of the period that begins then, by the wand's clock: the share by which the LED rises later and
  // falls earlier.
  double EdgeAt(double led_time_s) const {
    constexpr double kRoundingS = 1e-6;  // a period that begins with a bit belongs to it
    const bool dimmed = code != nullptr && code->IsDimmed(led_time_s + on_s + kRoundingS);
    return dimmed ? kLightCodeEdge : 0;
  }
};

// Of the middle one of the target's markers.
inline SentCode SentCodeOf(const FrameRenderOptions& options, const Target& target, size_t marker) {
  const auto middle = static_cast<size_t>(target.marker_count()) / 2;
  if (options.light_code == 0 || marker != middle) return {};
  return {&LightCode::Of(static_cast<uint32_t>(options.light_code)), options.wand_on_s};
}

}  // namespace rigcal
