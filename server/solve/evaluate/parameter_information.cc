// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/parameter_information.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "common/statistics/robust_statistics.h"
#include "server/solve/bundle/bundle_path.h"
#include "server/solve/evaluate/grouped_problem.h"
#include "server/solve/evaluate/joined_cameras.h"
#include "server/solve/evaluate/parameter_gains.h"
#include "server/solve/evaluate/parameter_knowledge.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxCameraGroups = 32;
constexpr size_t kSpansOfSession = 10, kMaxSpans = 40;

// Middle of the waved volume.
Eigen::Vector3d MiddleOfInstants(const BundleProblem& problem) {
  Eigen::Vector3d middle_m = Eigen::Vector3d::Zero();
  for (int i = 0; i < 3; ++i) {
    std::vector<double> values;
    for (const BundleInstant& instant : problem.instants) values.push_back(instant.origin_m[i]);
    if (!values.empty()) middle_m[i] = UpperMedian(&values);
  }
  return middle_m;
}

class InformationMeter {
 public:
  InformationMeter(GroupedProblem grouped, const Eigen::Matrix3d& axes)
      : grouped_(std::move(grouped)),
        axes_(axes),
        middle_m_(MiddleOfInstants(grouped_.problem)),
        wanted_(WantedParametersOf(grouped_)) {}

  std::optional<CalibrationInformation> Run() {
    all_ = grouped_.problem;
    const JoinedCameras joined = JoinCameras(all_);
    const auto information = ComputeInformation(BundleOptions(), all_);
    if (!information.ok()) return std::nullopt;
    const ParameterKnowledge known(*information);
    known_ = &known;
    result_.stride = static_cast<uint32_t>(grouped_.stride);
    const std::vector<double> variances = Variances(known, all_, joined);
    for (size_t p = 0; p < wanted_.size(); ++p) {
      if (!std::isfinite(variances[p])) return std::nullopt;
      const WantedParameter& wanted = wanted_[p];
      result_.parameters.push_back({all_.cameras[wanted.camera].name,
                                    wanted.kind,
                                    wanted.name,
                                    std::sqrt(variances[p] / static_cast<double>(grouped_.stride)),
                                    {}});
    }
    AddSessions();
    AddSpans();
    AddCameras();
    known_ = nullptr;
    return std::move(result_);
  }

 private:
  std::vector<double> Variances(const ParameterKnowledge& knowledge, const BundleProblem& problem,
                                const JoinedCameras& joined) const {
    const ParameterGains gains(grouped_, knowledge, problem, joined, middle_m_, axes_);
    std::vector<double> variances(wanted_.size(), kUndetermined);
    std::vector<ParameterKnowledge::Gain> known;
    std::vector<size_t> place;
    for (size_t p = 0; p < wanted_.size(); ++p) {
      ParameterKnowledge::Gain gain;
      if (!gains.Of(wanted_[p], &gain)) continue;
      known.push_back(std::move(gain));
      place.push_back(p);
    }
    const std::vector<double> of_known = knowledge.Variances(known, gains.common());
    for (size_t i = 0; i < place.size(); ++i) variances[place[i]] = of_known[i];
    return variances;
  }

  void AddGroup(InformationGroup group, const std::function<bool(size_t)>& keeps, int left_out) {
    BundleProblem rest = Rest(grouped_, keeps, left_out);
    const JoinedCameras joined = JoinCameras(rest);
    FixWhatIsSeen(grouped_, joined, &rest);
    const auto information = ComputeInformation(BundleOptions(), rest);
    std::vector<double> without(wanted_.size(), kUndetermined), with = without;
    if (information.ok()) {
      const ParameterKnowledge knowledge(*information);
      without = Variances(knowledge, rest, joined);
      // Over the same cameras and clocks.
      with = Variances(*known_, all_, joined);
    }
    for (size_t p = 0; p < wanted_.size(); ++p) {
      float share = 1;
      if (static_cast<int>(wanted_[p].camera) == left_out) {
        share = -1;
      } else if (std::isfinite(without[p]) && std::isfinite(with[p])) {
        share = static_cast<float>(without[p] > 0 ? std::clamp(1 - with[p] / without[p], 0.0, 1.0)
                                                  : 0.0);
      }
      result_.parameters[p].share.push_back(share);
    }
    result_.groups.push_back(std::move(group));
  }

  void AddSessions() {
    if (grouped_.session_ids.size() < 2) return;
    for (size_t s = 0; s < grouped_.session_ids.size(); ++s) {
      InformationGroup group;
      group.kind = InformationGroup::Kind::kSession;
      group.session_id = grouped_.session_ids[s];
      const auto in_group = [&](size_t i) { return grouped_.session[i] == static_cast<int>(s); };
      group.instant_count = Count(in_group);
      AddGroup(
          std::move(group), [&](size_t i) { return !in_group(i); }, -1);
    }
  }

  void AddSpans() {
    const size_t spans =
        std::min(kSpansOfSession, kMaxSpans / std::max<size_t>(1, grouped_.session_ids.size()));
    for (size_t s = 0; s < grouped_.session_ids.size(); ++s) {
      if (spans < 2 || grouped_.is_static[s]) continue;
      double end_s = 0;
      for (size_t i = 0; i < grouped_.session.size(); ++i) {
        if (grouped_.session[i] == static_cast<int>(s)) end_s = std::max(end_s, grouped_.time_s[i]);
      }
      for (size_t span = 0; span < spans; ++span) {
        InformationGroup group;
        group.kind = InformationGroup::Kind::kSpan;
        group.session_id = grouped_.session_ids[s];
        group.from_s = end_s * static_cast<double>(span) / static_cast<double>(spans);
        group.to_s = end_s * static_cast<double>(span + 1) / static_cast<double>(spans);
        const bool is_last = span + 1 == spans;
        const double from_s = group.from_s, to_s = group.to_s;
        const auto in_group = [&](size_t i) {
          return grouped_.session[i] == static_cast<int>(s) && grouped_.time_s[i] >= from_s &&
                 (is_last || grouped_.time_s[i] < to_s);
        };
        group.instant_count = Count(in_group);
        AddGroup(
            std::move(group), [&](size_t i) { return !in_group(i); }, -1);
      }
    }
  }

  void AddCameras() {
    if (grouped_.problem.cameras.size() > kMaxCameraGroups) return;
    for (size_t c = 0; c < grouped_.problem.cameras.size(); ++c) {
      InformationGroup group;
      group.kind = InformationGroup::Kind::kCamera;
      group.camera = grouped_.problem.cameras[c].name;
      group.instant_count = Count([&](size_t i) {
        bool seen = false;
        ForEachUsedMarker(grouped_.problem, grouped_.problem.instants[i],
                          [&](const BundleObservation& observation, const BundleMarker&) {
                            seen |= observation.camera == static_cast<int>(c);
                          });
        return seen;
      });
      AddGroup(
          std::move(group), [](size_t) { return true; }, static_cast<int>(c));
    }
  }

  template <typename InGroup>
  uint32_t Count(const InGroup& in_group) const {
    uint32_t count = 0;
    for (size_t i = 0; i < grouped_.problem.instants.size(); ++i) count += in_group(i) ? 1 : 0;
    return count * static_cast<uint32_t>(grouped_.stride);
  }

  const GroupedProblem grouped_;
  const Eigen::Matrix3d axes_;
  const Eigen::Vector3d middle_m_;
  const std::vector<WantedParameter> wanted_;
  BundleProblem all_;
  const ParameterKnowledge* known_ = nullptr;
  CalibrationInformation result_;
};

}  // namespace

std::optional<CalibrationInformation> MeasureInformation(const RigObservations& rig,
                                                         const RigSolution& solution,
                                                         const Eigen::Matrix3d& new_from_rig) {
  GroupedProblem grouped = GroupInstants(rig, solution);
  if (grouped.problem.instants.empty()) return std::nullopt;
  return InformationMeter(std::move(grouped), new_from_rig).Run();
}

}  // namespace rigcal::server
