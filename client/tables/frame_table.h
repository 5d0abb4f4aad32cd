// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "rigcal/v1/calibration.pb.h"
#include "rigcal/v1/information.pb.h"

namespace rigcal::client {

// Which frame the poses are in: one line, then of a frame that was made its transform, sigmas and
// residuals.
std::string FormatFrame(const rigcal::v1::Calibration& calibration);

// What a new scale was made from, and what each source says; empty where there is none.
std::string FormatScaleSources(const rigcal::v1::Calibration& calibration);

// By camera and parameter its sigma, and the session, span of time and camera that hold most of it;
// then sentences about what rests on one of them.
std::string FormatInformation(const std::string& id,
                              const rigcal::v1::CalibrationInformation& information);

}  // namespace rigcal::client
