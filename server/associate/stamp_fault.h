// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace rigcal::server {

// Something about the rows of one camera in one session that the rows themselves show.
struct StampFault {
  enum class Kind {
    kSteps,       // its clock was set; size: the largest step, seconds, positive where forward
    kOutOfOrder,  // rows that were not in the order of their stamps; size: how many
    kRepeat,      // rows that have the stamp of the row before; size: their share, percent
    kBursts,      // rows whose stamps come in groups; size: their share, percent
    kTwice,       // rows that come several times; size: how many were taken away
    kAtOrigin,    // markers at (0, 0), taken as not seen; size: how many
    kCopied,      // rows that another camera has as well; size: their share, percent
    kFrozen,      // rows that show the row before again; size: their share, percent
    kFarClock,    // it counts from another beginning; size: its offset, milliseconds
    kLightContradicts,  // of its readings of a wand's light code, those of others; size: percent
    kOtherWand,         // it has read the light code of another wand; size: that one's number
    kSetByLight,        // its clock was set by a wand's light code; size: by how much, seconds
    kWandRate,          // of no camera: the wand's clock; size: percent, positive where fast
  };
  Kind kind = Kind::kSteps;
  std::string session_id, camera;
  double size = 0;
  std::string what;  // a sentence without a full stop
};

}  // namespace rigcal::server
