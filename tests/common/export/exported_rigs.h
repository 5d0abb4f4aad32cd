// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "rigcal/v1/calibration.pb.h"

namespace rigcal::testing {

enum class TestLens { kPinhole, kBrown4, kBrown5, kRational, kFisheye };

// A succeeded calibration of one camera for each name, of different sizes and poses, all with
// lenses of this kind. `square`: one focal length for both axes.
v1::Calibration CalibrationOfLens(TestLens lens, const std::vector<std::string>& names,
                                  bool square = false);

}  // namespace rigcal::testing
