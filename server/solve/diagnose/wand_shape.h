// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "server/solve/diagnose/session_timeline.h"
#include "server/solve/diagnose/trial_solve.h"

namespace rigcal::server {

// The shape of a wand of three markers at each instant, from its markers as the cameras place each
// by itself, beside the straight wand that was solved.

// A marker of an instant as one camera sees it.
struct WandSample {
  size_t instant = 0, marker = 0;                      // of the problem
  int camera = 0, place = 0;                           // on the wand: 0, 1 or 2
  Eigen::Vector2d residual = Eigen::Vector2d::Zero();  // predicted minus measured, pixels
  Eigen::Matrix<double, 2, 3> by_point = Eigen::Matrix<double, 2, 3>::Zero();  // d pixel / d metre
};

// What an instant says, metres: how far the middle marker is from the line through the two others
// (a vector across the wand, in the rig), and by how much each span is longer than was solved.
struct WandShape {
  size_t instant = 0;
  int64_t time_ns = 0;  // of the timeline
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();
  Eigen::Vector3d off_line_m = Eigen::Vector3d::Zero();
  double span_m[2] = {0, 0};
};

// How the wand's shape differs from a straight one that stays as it is.
struct WandFault {
  enum class Form : uint8_t {
    kBends,  // its middle is off the line, in a direction that turns with it
    kSags,   // its middle is off the line in one direction of the rig, the more the more it lies
    kSlips,  // one marker is moved along it from some time on
  };
  Form form = Form::kBends;
  double size_m = 0, sigma_m = 0;
  int place = 1;        // of the marker that slips
  int64_t time_ns = 0;  // of the slip
  Eigen::Vector3d sag_m = Eigen::Vector3d::Zero();
  std::vector<WandShape> shapes;  // of the instants
};

// Of a trial whose target is one wand of three markers; else nothing. Markers further off than 60
// px take no part.
std::vector<WandSample> WandSamplesOf(const TrialProblem& trial);

// By instant, of those where two cameras see all three markers.
std::vector<WandShape> WandShapesOf(const TrialProblem& trial, const SessionTimeline& timeline,
                                    const std::vector<WandSample>& samples);

// Of the mean error of `samples`, pixels: what goes away where each camera's markers are moved off
// the line as the *other* cameras of the instant see it. Noise, and cameras that are wrong, do not
// predict each other.
double BendGainPx(const TrialProblem& trial, const std::vector<WandSample>& samples);

// The best of each form. The size of a bend: root of the mean product of what one half of an
// instant's cameras sees and the other half, in which the noise of neither is.
WandFault BendOf(const TrialProblem& trial, const std::vector<WandSample>& samples,
                 const std::vector<WandShape>& shapes);
WandFault SagOf(const std::vector<WandShape>& shapes);
std::optional<WandFault> SlipOf(const std::vector<WandShape>& shapes);

// Moves the measured centres to where a straight wand that stays as it is would have been seen.
void Straighten(const WandFault& fault, const std::vector<WandSample>& samples,
                const SessionTimeline& timeline, TrialProblem* trial);

}  // namespace rigcal::server
