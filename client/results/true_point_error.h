// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "common/calibration/calibration.h"
#include "common/simulation/world/simulated_world.h"

namespace rigcal::client {

// What the headline of a calibration of a simulated rig predicts (Headline::point_error_m): exact
// images of the target's markers along its true path, triangulated with the calibration; their
// distance from the truth that 95 % of them stay below, metres, after the rigid alignment that fits
// best (Umeyama 1991, c = 1) and with the calibrated target as long as the true one. None: the
// scale is not known, the target has no length, or hardly a place is seen by two cameras.
std::optional<double> TruePointErrorM(const CalibrationResult& calibration,
                                      const SimulatedWorld& world);

}  // namespace rigcal::client
