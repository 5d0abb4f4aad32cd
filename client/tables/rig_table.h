// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "rigcal/v1/calibration_service.pb.h"
#include "rigcal/v1/live.pb.h"
#include "rigcal/v1/rig_service.pb.h"
#include "rigcal/v1/session_service.pb.h"

namespace rigcal::client {

// Rigs, their history, and how calibrations of them differ, as people read them.

std::string FormatRigList(const rigcal::v1::ListRigsResponse& response);
std::string FormatRig(const rigcal::v1::Rig& rig);
std::string FormatActivation(const rigcal::v1::Activation& activation);
std::string FormatHistory(const rigcal::v1::ListActivationsResponse& response);
std::string FormatPruned(const rigcal::v1::PruneSessionsResponse& response, bool dry_run);

// What the server's monitor says of a rig, camera by camera.
std::string FormatMonitor(const rigcal::v1::LiveMonitor& monitor);

// What a calibration derives from, what was held, who asked for it and why; "" for a plain one.
std::string FormatDerivation(const rigcal::v1::Calibration& calibration);

// Camera by camera in millimetres, degrees and pixels, with the frame they are in.
std::string FormatDifference(const rigcal::v1::CompareCalibrationsResponse& difference);
// Cameras with a verdict, joined by ", ".
std::string CamerasWith(const rigcal::v1::CompareCalibrationsResponse& difference,
                        rigcal::v1::CameraDifference::Verdict verdict);

}  // namespace rigcal::client
