// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>

#include "agent/identify/outline_rows.h"
#include "agent/identify/sphere_outline_fit.h"

namespace rigcal::agent {

// What is known of a sphere before a part of its outline is left out.
struct ArcExpectation {
  double radius_px = 0, radius_sigma_px = 0;  // 0: not known
  Eigen::Vector2d stretch = Eigen::Vector2d::Zero();
  double stretch_sigma = 0.03;
  double scatter = 1;            // of the pixels' noise, as a ratio of variances
  double edge_variance_px2 = 0;  // of a sector's edge beyond the pixels' noise
  bool is_cut = false;           // by the image's border: the arc alone hardly tells its radius
};

// The part of a sphere's outline that is seen. What hides a part of a sphere (a hand, the stick, a
// piece of furniture) ends inside of the outline, so in some neighbouring sectors the edge is
// further in than an ellipse through the others' edges.
struct VisibleArc {
  std::array<bool, kOutlineSectors> hidden{};
  int hidden_count = 0;
  int known_count = 0;                                // of the sectors, in which the edge is seen
  Eigen::Vector2d missing = Eigen::Vector2d::Zero();  // mean of the other sectors' directions
  double moved_px = 0;                                // the centre, when they were left out
  double whole_chi_squared = 0;  // of an ellipse through all edges, before any was left out
  OutlinePixels pixels;          // of the others; those of hidden sectors count nothing
  bool failed = false;           // no outline through the others
  bool stays = false;            // the same sectors were found again

  bool is_all() const { return hidden_count == 0; }
};

// Fits `outline`, which was fitted to `pixels` with `light`, anew without the sectors that are
// hidden, if there are any. For every gap of neighbouring sectors the edges of the others are
// fitted by an ellipse in first order; the gap that explains the edges best, if much better than
// none, is taken when its edges are further in. Then the outline is fitted to the other pixels and
// the gap is looked for again, until it stays.
// The outline of a sphere that the border cuts is always fitted anew, with what is expected.
VisibleArc FindVisibleArc(const OutlinePixels& pixels, const Eigen::Matrix2d& second_moment_px2,
                          const SphereShading& light, const ArcExpectation& expected,
                          SphereOutlineFitter* fitter, SphereOutline* outline);

}  // namespace rigcal::agent
