// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "common/calibration/parameter_information.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"

namespace rigcal::server {

// Which sessions, spans of time and cameras hold which parameter of a solution: for each group of
// observations the information that is lost when its rows are left out,
//   share = 1 - (variance with them) / (variance without them),
// by the information of the bundle adjustment at its optimum, the weights of the markers kept. That
// is the deletion diagnostic of Belsley, Kuh and Welsch (Regression Diagnostics, 1980, section 2.1:
// COVRATIO), group by group and for one parameter at a time.
//
// Poses are taken after the best rigid motion of the cameras that the rest of the data still joins,
// and with the target's lengths as they are: neither a choice of the frame nor the scale is part of
// them. In a repair the kept cameras are the frame. Offsets are against the mean clock of the
// session. What a prior of an earlier calibration says (a refinement) is not counted, nor what a
// path through time adds to the instants. Of many markers every n-th instant is looked at; groups
// of cameras are those of rigs of up to 32.
//
// `new_from_rig`: axes of the positions. None: the data leave something undetermined.
std::optional<CalibrationInformation> MeasureInformation(const RigObservations& rig,
                                                         const RigSolution& solution,
                                                         const Eigen::Matrix3d& new_from_rig);

}  // namespace rigcal::server
