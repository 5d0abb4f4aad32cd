// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "rigcal/v1/calibration_service.pb.h"
#include "rigcal/v1/session_service.pb.h"

namespace rigcal::client {

// Of more cameras than this a table lists those that need something, unless all are asked for.
inline constexpr size_t kFewCameras = 16;

// "488 good, 12 need something: a, b, c, ...": the names of the first few. `count`: of all cameras.
std::string NeedsSummary(size_t count, const std::vector<std::string>& needing);

// Names of the cameras that need something, in the order of the message: those that a warning or
// an error of the findings names; those that are away, have not ended in time, or have lost
// pictures or rows.
std::vector<std::string> CamerasInNeed(const rigcal::v1::Calibration& calibration);
std::vector<std::string> CamerasInNeed(const rigcal::v1::Session& session);

// Leaves of more than kFewCameras cameras those that need something, and where there are none the
// first few; and of the findings those that are more than a note. Returns the line that says so,
// ended by a newline; "" where everything is kept.
std::string KeepNotableCameras(rigcal::v1::Calibration* calibration);
std::string KeepNotableCameras(rigcal::v1::Session* session);

}  // namespace rigcal::client
