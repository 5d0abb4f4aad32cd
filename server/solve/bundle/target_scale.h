// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// Gives a problem the scale at which the priors of its target's spans cost least, and returns by
// how much the cost fell. Cameras, instants and marker positions move together, away from the fixed
// camera or towards it: every marker stays where it was in every image. An adjustment leaves this
// to the last, because images say nothing about the scale, and the priors next to nothing beside
// some thousand markers: its steps would creep towards it, and stop before.
//
// Does nothing where the scale is not free: the target is fixed or has one marker, a distance is
// given, marker 0 is not at 0, fixed cameras are in different places.
double SettleScale(BundleProblem* problem);

}  // namespace rigcal::server
