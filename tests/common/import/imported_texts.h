// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "common/import/imported_rig.h"

namespace rigcal::testing {

// Cameras in a ring that look at one point 3 m away, named 101, 102, ... `lens`: of all.
std::vector<ImportedCamera> RingOfCameras(int count, const std::vector<double>& distortion);

// The rig as QTM writes it, in 64ths of a pixel, and as Theia does.
std::string QtmText(const std::vector<ImportedCamera>& cameras);
std::string TheiaText(const std::vector<ImportedCamera>& cameras);

// The rig as Vicon writes it, with these coefficients of r^2 and r^4 in pixels about the principal
// point instead of a lens of ours.
std::string ViconText(const std::vector<ImportedCamera>& cameras, double k1, double k2);

}  // namespace rigcal::testing
