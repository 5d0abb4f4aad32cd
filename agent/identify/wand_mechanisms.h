// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace rigcal::agent {

// Parts of the search for a wand that can be left out, to measure what each of them is worth
// (`rigcal-accuracy detection_value --without`).
enum class WandMechanism : uint32_t {
  kRestoredOutlines,  // spheres that only their outlines show to be whole
  kLambertShading,    // white light by Lambert's law
  kOtherSpheres,      // size and softness that the other spheres predict
  kPaleLevels,        // colours paler than configured
};

// The mechanisms that are left out.
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
