// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace rigcal::agent {

// Parts of the search for a wand that can be left out, to measure what each is worth
// (`rigcal-accuracy detection_value --without`).
enum class WandMechanism : uint32_t {
  kPartialWands,      // two whole spheres and a part of the third, or where nothing found the third
  kThirdByContrast,   // the second of these alone
  kHiddenSpheres,     // three spheres of which one is not seen whole
  kStickSight,        // the stick between two spheres as evidence for partial wands
  kAlikeThings,       // rows of things that look like the spheres, and such things near by
  kBars,              // three pieces of one bar are no wand
  kEvidence,          // of outlines and colours, besides the cost
  kChance,            // a better wand is asked for where many sets were tried
  kRestoredOutlines,  // spheres that are whole by their outlines only
  kColourOutlines,    // outlines by colour without white
  kLambertShading,    // white light as Lambert's law has it
  kVisibleArcs,       // a part of an outline that something hides is left out
  kBesideOutlines,    // outlines against what is right beside the sphere
  kUnsureBackground,  // pixels whose background is not known count less
  kOtherSpheres,      // the size and softness that the others say, of centres
  kOutlinesByOthers,  // the same, of outlines that cannot be told from what is beside them
  kBrighterLevels,    // where much passes the colour test
  kPaleLevels,
  kClippedLevel,
  kWhitenedLevel,
  kDimLevel,
  kContrastLevel,
  kSpotsBefore,      // spots of the level before beside those by contrast
  kDiscPairs,        // blobs that may be two overlapping spheres
  kDiscs,            // discs within patches
  kPieces,           // brighter pieces of patches
  kColouredPatches,  // pieces of patches that have a colour
};

// Those that are left out.
class WandMechanisms {
 public:
  void Insert(WandMechanism mechanism) { bits_ |= Bit(mechanism); }
  bool Has(WandMechanism mechanism) const { return (bits_ & Bit(mechanism)) != 0; }

 private:
  static uint32_t Bit(WandMechanism mechanism) {
    return uint32_t{1} << static_cast<uint32_t>(mechanism);
  }

  uint32_t bits_ = 0;
};

}  // namespace rigcal::agent
