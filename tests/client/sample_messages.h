// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "common/simulation/world/simulated_world.h"
#include "rigcal/v1/calibration.pb.h"
#include "rigcal/v1/session.pb.h"

namespace rigcal::testing {

// A calibration with every part of it filled, of cameras "left" and "right".
v1::Calibration FullCalibration(const std::string& id = "cal-1");

// A capturing session of cameras "left" and "right", with refusals.
v1::Session FullSession(const std::string& id = "wave");

// A succeeded calibration that is exactly the world's truth, in the frame of its first camera.
v1::Calibration TrueCalibration(const SimulatedWorld& world);

}  // namespace rigcal::testing
