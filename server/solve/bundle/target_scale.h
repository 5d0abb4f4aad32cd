// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

struct SettledScale {
  double factor = 1;                                   // of every length; 1: nothing was done
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();  // what the lengths grow about
  double gain = 0;                                     // by how much the cost fell
};

// Gives a problem the scale at which its priors cost least, in closed form: with lengths l_i of the
// shape, lengths g_i that they are given as and sigmas s_i,
//
//   factor = sum l_i g_i / s_i^2  /  sum l_i^2 / s_i^2
//
// over the spans of every wand, the coordinates of every rigid part about its middle (turned onto
// the given ones: Umeyama 1991), and the distance between two cameras. Cameras, instants and the
// target move together, away from the fixed camera or towards it: every marker stays where it was
// in every image. An adjustment leaves this to the last, because images say nothing about the
// scale, and the priors next to nothing beside some thousand markers: its steps would creep towards
// it, and stop before.
//
// Markers that nothing used shows are no part of the shape; they follow the others as their priors
// have it.
//
// Does nothing where the scale is not free: lengths of a target are fixed, fixed cameras are in
// different places, no length is known.
SettledScale SettleScale(BundleProblem* problem);

// Where the cameras are whose poses are fixed; none where that is not one place, which gives the
// problem its scale.
std::optional<Eigen::Vector3d> FixedCentre(const BundleProblem& problem);

}  // namespace rigcal::server
