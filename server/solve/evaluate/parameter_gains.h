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

  // False: not determined.
  bool Of(const WantedParameter& wanted, Eigen::VectorXd* gain) const;

 private:
  Eigen::MatrixXd PointRows(size_t camera, const Eigen::Vector3d& point_m) const;
  void FitMotion(const Eigen::Vector3d& middle_m);
  bool Offset(size_t camera, Eigen::VectorXd* gain) const;

  const GroupedProblem& grouped_;
  const ParameterKnowledge& knowledge_;
  const BundleProblem& problem_;
  const JoinedCameras& joined_;
  const Eigen::Matrix3d axes_;
  bool has_motion_ = false, motion_known_ = false;
  Eigen::MatrixXd motion_;  // turn and shift, by the parameters
};

}  // namespace rigcal::server
