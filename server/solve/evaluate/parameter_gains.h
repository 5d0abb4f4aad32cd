// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "common/calibration/parameter_information.h"
#include "server/solve/evaluate/grouped_problem.h"
#include "server/solve/evaluate/joined_cameras.h"
#include "server/solve/evaluate/parameter_knowledge.h"

namespace rigcal::server {

// The parameters that are told about, one after the other.
struct WantedParameter {
  size_t camera = 0;
  ParameterInformation::Kind kind = ParameterInformation::Kind::kPosition;
  int component = 0;
  std::string name;
};
std::vector<WantedParameter> WantedParametersOf(const GroupedProblem& grouped);

// Gains of all that is wanted, by the rows of one knowledge. Poses are taken after the best rigid
// motion of the joined cameras, offsets against the mean of the clocks that are seen. The arguments
// outlive it.
class ParameterGains {
 public:
  // `middle_m`: a place that the cameras look at; `axes`: those of the positions.
  ParameterGains(const GroupedProblem& grouped, const ParameterKnowledge& knowledge,
                 const BundleProblem& problem, const JoinedCameras& joined,
                 const Eigen::Vector3d& middle_m, const Eigen::Matrix3d& axes);

  // Columns that the gains have in common.
  const Eigen::MatrixXd& common() const { return common_; }
  // False: not determined.
  bool Of(const WantedParameter& wanted, ParameterKnowledge::Gain* gain) const;

 private:
  // How a point that the camera carries along moves by a parameter of the camera, if it is free.
  struct PointColumn {
    Eigen::Index row = 0;
    Eigen::Vector3d derivative_m;
  };
  std::vector<PointColumn> PointColumns(size_t camera, const Eigen::Vector3d& point_m) const;
  void FitMotion(const Eigen::Vector3d& middle_m);
  void AddMeanOffsets();
  bool Offset(size_t camera, ParameterKnowledge::Gain* gain) const;

  const GroupedProblem& grouped_;
  const ParameterKnowledge& knowledge_;
  const BundleProblem& problem_;
  const JoinedCameras& joined_;
  const Eigen::Matrix3d axes_;
  bool has_motion_ = false, motion_known_ = false;
  // Turn and shift of the whole rig, where there is a motion, and the mean offset of each session.
  Eigen::MatrixXd common_;
};

}  // namespace rigcal::server
