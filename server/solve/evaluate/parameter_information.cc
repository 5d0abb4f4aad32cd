// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/parameter_information.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/statistics/robust_statistics.h"
#include "server/solve/bundle/bundle_path.h"

namespace rigcal::server {
namespace {

using InformationKind = ParameterInformation::Kind;

constexpr size_t kMaxInformationMarkers = 60'000;
constexpr size_t kMaxCameraGroups = 32;
constexpr size_t kSpansOfSession = 10, kMaxSpans = 40;
// Of a system with a unit diagonal: what is smaller is no information.
constexpr double kNullEigenvalue = 1e-11;
// Squared part of a parameter in what is not determined.
constexpr double kNullShare = 1e-6;
constexpr Eigen::Index kMaxEigenSize = 400;
constexpr double kUndetermined = std::numeric_limits<double>::infinity();

Eigen::Matrix3d CrossProductMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d cross;
  cross << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return cross;
}

// Every n-th used instant with its session and time; the target's lengths as they are.
struct GroupedProblem {
  BundleProblem problem;
  std::vector<int> session;    // by instant
  std::vector<double> time_s;  // by instant, since the first of its session
  std::vector<std::string> session_ids;
  std::vector<bool> is_static;  // by session: its times are made up
  std::vector<int> clock_of_camera;
  std::vector<std::vector<int>> clocks_of_session;
  size_t stride = 1;
};

void AppendInstant(const BundleProblem& from, size_t index, BundleProblem* to) {
  BundleInstant instant = from.instants[index];
  instant.first_observation = static_cast<int>(to->observations.size());
  for (BundleObservation observation : from.ObservationsOf(from.instants[index])) {
    const auto markers = from.MarkersOf(observation);
    observation.first_marker = static_cast<int>(to->markers.size());
    to->markers.insert(to->markers.end(), markers.begin(), markers.end());
    to->observations.push_back(observation);
  }
  to->instants.push_back(instant);
}

GroupedProblem GroupInstants(const RigObservations& rig, const RigSolution& solution) {
  const BundleProblem& all = solution.built.problem;
  GroupedProblem grouped;
  BundleProblem& problem = grouped.problem;
  problem.cameras = all.cameras;
  problem.clocks = all.clocks;
  problem.target = all.target;
  problem.rigid_target = all.rigid_target;
  problem.target.fixed = problem.rigid_target.fixed = true;
  problem.distance = all.distance;
  grouped.stride = (all.markers.size() + kMaxInformationMarkers - 1) / kMaxInformationMarkers;
  grouped.stride = std::max<size_t>(1, grouped.stride);
  grouped.clock_of_camera.assign(all.cameras.size(), -1);
  size_t used = 0;
  int64_t first_ns = 0;
  for (size_t i = 0; i < all.instants.size(); ++i) {
    if (!all.instants[i].used || used++ % grouped.stride != 0) continue;
    const auto track = static_cast<size_t>(solution.instants.instants[i].members.front().track);
    const std::string& session = rig.tracks[track].track.session_id;
    if (grouped.session_ids.empty() || grouped.session_ids.back() != session) {
      grouped.session_ids.push_back(session);
      grouped.is_static.push_back(rig.tracks[track].is_static);
      first_ns = solution.built.instant_time_ns[i];
    }
    grouped.session.push_back(static_cast<int>(grouped.session_ids.size()) - 1);
    grouped.time_s.push_back(1e-9 *
                             static_cast<double>(solution.built.instant_time_ns[i] - first_ns));
    AppendInstant(all, i, &problem);
  }
  grouped.clocks_of_session.resize(grouped.session_ids.size());
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    const auto found = std::ranges::find(grouped.session_ids, rig.tracks[t].track.session_id);
    if (found == grouped.session_ids.end()) continue;
    const int clock = rig.index.clock_of_track[t];
    int& first = grouped.clock_of_camera[static_cast<size_t>(rig.index.camera_of_track[t])];
    if (first < 0) first = clock;
    std::vector<int>& clocks =
        grouped.clocks_of_session[static_cast<size_t>(found - grouped.session_ids.begin())];
    if (std::ranges::find(clocks, clock) == clocks.end()) clocks.push_back(clock);
  }
  return grouped;
}

// The rest of an instant still places the target.
bool StillPlaces(const BundleProblem& problem, const BundleInstant& instant) {
  std::map<int, std::set<int>> cameras_of_marker;
  std::set<int> cameras;
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    for (const BundleMarker& marker : problem.MarkersOf(observation)) {
      if (!marker.used) continue;
      cameras_of_marker[marker.marker].insert(observation.camera);
      cameras.insert(observation.camera);
    }
  }
  const size_t wanted = instant.is_point || problem.IsPoint() ? 1 : instant.is_rigid ? 3 : 2;
  const auto shared = std::ranges::count_if(
      cameras_of_marker, [](const auto& entry) { return entry.second.size() >= 2; });
  return cameras.size() >= 2 && static_cast<size_t>(shared) >= wanted;
}

// Without an instant that `keeps` refuses, and without a camera (-1: all stay).
template <typename Keeps>
BundleProblem Rest(const GroupedProblem& grouped, const Keeps& keeps, int left_out) {
  BundleProblem rest = grouped.problem;
  for (size_t i = 0; i < rest.instants.size(); ++i) {
    BundleInstant& instant = rest.instants[i];
    instant.used = instant.used && keeps(i);
    if (!instant.used || left_out < 0) continue;
    bool changed = false;
    for (const BundleObservation& observation : rest.ObservationsOf(instant)) {
      if (observation.camera != left_out) continue;
      for (int m = 0; m < observation.marker_count; ++m) {
        rest.markers[static_cast<size_t>(observation.first_marker + m)].used = false;
        changed = true;
      }
    }
    if (changed) instant.used = StillPlaces(rest, instant);
  }
  return rest;
}

// Cameras that common instants join, the largest set of them; and clocks that are seen.
struct Joined {
  std::vector<bool> camera, clock;
};

Joined JoinedCameras(const BundleProblem& problem) {
  const size_t count = problem.cameras.size();
  std::vector<size_t> parent(count);
  std::iota(parent.begin(), parent.end(), size_t{0});
  const auto root = [&parent](size_t c) {
    while (parent[c] != c) c = parent[c];
    return c;
  };
  Joined joined{std::vector<bool>(count, false), std::vector<bool>(problem.clocks.size(), false)};
  std::vector<bool> seen(count, false);
  for (const BundleInstant& instant : problem.instants) {
    int first = -1;
    ForEachUsedMarker(problem, instant,
                      [&](const BundleObservation& observation, const BundleMarker&) {
                        const auto camera = static_cast<size_t>(observation.camera);
                        seen[camera] = true;
                        joined.clock[static_cast<size_t>(observation.clock)] = true;
                        if (first < 0) first = observation.camera;
                        parent[root(camera)] = root(static_cast<size_t>(first));
                      });
  }
  std::map<size_t, int> sizes;
  for (size_t c = 0; c < count; ++c) sizes[root(c)] += seen[c] ? 1 : 0;
  const auto largest =
      std::ranges::max_element(sizes, {}, [](const auto& entry) { return entry.second; });
  for (size_t c = 0; c < count; ++c) {
    joined.camera[c] = seen[c] && root(c) == largest->first;
  }
  return joined;
}

// The one fixed camera and each session's fixed clock must be among what is seen.
void FixWhatIsSeen(const GroupedProblem& grouped, const Joined& joined, BundleProblem* problem) {
  const auto fixed = std::ranges::count(problem->cameras, true, &BundleCamera::pose_fixed);
  if (fixed == 1) {
    const auto first = std::ranges::find(joined.camera, true) - joined.camera.begin();
    const auto own = std::ranges::find(problem->cameras, true, &BundleCamera::pose_fixed);
    if (!joined.camera[static_cast<size_t>(own - problem->cameras.begin())] &&
        first < static_cast<std::ptrdiff_t>(joined.camera.size())) {
      own->pose_fixed = false;
      problem->cameras[static_cast<size_t>(first)].pose_fixed = true;
    }
  }
  for (const std::vector<int>& clocks : grouped.clocks_of_session) {
    int seen = -1;
    bool has_fixed = false, any_free = false;
    for (const int k : clocks) {
      const BundleClock& clock = problem->clocks[static_cast<size_t>(k)];
      any_free |= !clock.offset_fixed;
      if (!joined.clock[static_cast<size_t>(k)]) continue;
      if (seen < 0) seen = k;
      has_fixed |= clock.offset_fixed;
    }
    if (any_free && seen >= 0 && !has_fixed) {
      problem->clocks[static_cast<size_t>(seen)].offset_fixed = true;
      problem->clocks[static_cast<size_t>(seen)].rate_fixed = true;
    }
  }
}

// What is known of one set of parameters.
class Knowledge {
 public:
  explicit Knowledge(const ReducedInformation& information) : parameters_(information.parameters) {
    scale_ = information.information.diagonal().cwiseMax(0).cwiseSqrt();
    for (Eigen::Index i = 0; i < scale_.size(); ++i) scale_[i] = scale_[i] > 0 ? 1 / scale_[i] : 0;
    scaled_ = scale_.asDiagonal() * information.information * scale_.asDiagonal();
    factor_.compute(scaled_);
    if (factor_.info() == Eigen::Success && scale_.minCoeff() > 0) return;
    is_regular_ = false;
    if (scaled_.rows() <= kMaxEigenSize) eigen_.compute(scaled_);
  }

  Eigen::Index Row(const ReducedParameter& parameter) const {
    const auto found = std::ranges::find(parameters_, parameter);
    return found == parameters_.end() ? -1 : found - parameters_.begin();
  }
  Eigen::Index size() const { return scaled_.rows(); }

  double Variance(const Eigen::VectorXd& gain) const {
    const Eigen::VectorXd a = scale_.cwiseProduct(gain);
    if (is_regular_) return std::max(0.0, a.dot(factor_.solve(a)));
    if (eigen_.eigenvalues().size() == 0) return kUndetermined;
    const Eigen::VectorXd parts = eigen_.eigenvectors().transpose() * a;
    double variance = 0, lost = 0;
    for (Eigen::Index i = 0; i < parts.size(); ++i) {
      const double part = parts[i] * parts[i], value = eigen_.eigenvalues()[i];
      if (value > kNullEigenvalue) {
        variance += part / value;
      } else {
        lost += part;
      }
    }
    // What has no scale has no information at all.
    const bool touches_nothing = (scale_.array() == 0 && gain.array() != 0).any();
    return touches_nothing || lost > kNullShare * a.squaredNorm() ? kUndetermined : variance;
  }

 private:
  std::vector<ReducedParameter> parameters_;
  Eigen::VectorXd scale_;
  Eigen::MatrixXd scaled_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen_;
  bool is_regular_ = true;
};

// The parameters that are told about, one after the other.
struct Wanted {
  size_t camera = 0;
  InformationKind kind = InformationKind::kPosition;
  int component = 0;
  std::string name;
};

std::vector<Wanted> WantedOf(const GroupedProblem& grouped) {
  static constexpr std::array<const char*, 3> kAxes = {"x", "y", "z"};
  static constexpr std::array<const char*, 4> kFocal = {"fx", "fy", "cx", "cy"};
  std::vector<Wanted> wanted;
  const BundleProblem& problem = grouped.problem;
  const auto fixed = std::ranges::count(problem.cameras, true, &BundleCamera::pose_fixed);
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const BundleCamera& camera = problem.cameras[c];
    for (const InformationKind kind : {InformationKind::kPosition, InformationKind::kRotation}) {
      // With several of them the fixed ones are known, and nothing here holds them.
      if (camera.pose_fixed && fixed > 1) continue;
      for (int i = 0; i < 3; ++i) wanted.push_back({c, kind, i, kAxes[static_cast<size_t>(i)]});
    }
    const int clock = grouped.clock_of_camera[c];
    const bool estimated =
        clock >= 0 && std::ranges::any_of(problem.clocks,
                                          [](const BundleClock& one) { return !one.offset_fixed; });
    if (estimated) wanted.push_back({c, InformationKind::kTimeOffset, 0, "offset"});
    if (camera.intrinsics_fixed) continue;
    for (int i = 0; i < static_cast<int>(camera.intrinsics.size()); ++i) {
      if (!(camera.intrinsics_sigma[i] > 0)) continue;
      wanted.push_back(
          {c, InformationKind::kIntrinsic, i,
           i < 4 ? std::string(kFocal[static_cast<size_t>(i)]) : absl::StrCat("d", i - 3)});
    }
  }
  return wanted;
}

// Gains of all that is wanted, by the rows of one knowledge.
class Gains {
 public:
  // `cameras`: over which the frame is; `clocks`: over which the mean clock is.
  Gains(const GroupedProblem& grouped, const Knowledge& knowledge, const BundleProblem& problem,
        const Joined& joined, const Eigen::Vector3d& middle_m, const Eigen::Matrix3d& axes)
      : grouped_(grouped), knowledge_(knowledge), problem_(problem), joined_(joined), axes_(axes) {
    const auto fixed = std::ranges::count(problem.cameras, true, &BundleCamera::pose_fixed);
    if (fixed == 1) FitMotion(middle_m);
  }

  // False: not determined.
  bool Of(const Wanted& wanted, Eigen::VectorXd* gain) const {
    gain->setZero(knowledge_.size());
    switch (wanted.kind) {
      case InformationKind::kTimeOffset:
        return Offset(wanted.camera, gain);
      case InformationKind::kIntrinsic: {
        const Eigen::Index row = knowledge_.Row(
            {ReducedParameterKind::kIntrinsic, static_cast<int>(wanted.camera), wanted.component});
        if (row >= 0) (*gain)[row] = 1;
        return row >= 0;
      }
      default:
        break;
    }
    if (!joined_.camera[wanted.camera] || (has_motion_ && !motion_known_)) return false;
    const RigidTransform& pose = problem_.cameras[wanted.camera].cam_from_rig;
    const Eigen::Matrix3d rotation = pose.rotation.toRotationMatrix();
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(3, knowledge_.size());
    if (wanted.kind == InformationKind::kPosition) {
      const Eigen::Vector3d centre_m = pose.SourceFromTargetTranslation();
      rows = PointRows(wanted.camera, centre_m);
      if (has_motion_) rows -= MotionOf(centre_m) * motion_;
      rows = axes_ * rows;
    } else {
      for (int i = 0; i < 3; ++i) {
        const Eigen::Index row =
            knowledge_.Row({ReducedParameterKind::kRotation, static_cast<int>(wanted.camera), i});
        if (row >= 0) rows(i, row) = 1;
      }
      if (has_motion_) rows += rotation * motion_.topRows<3>();
    }
    *gain = rows.row(wanted.component).transpose();
    return true;
  }

 private:
  // A turn and a shift of everything, at a point.
  static Eigen::Matrix<double, 3, 6> MotionOf(const Eigen::Vector3d& point_m) {
    Eigen::Matrix<double, 3, 6> motion;
    motion << -CrossProductMatrix(point_m), Eigen::Matrix3d::Identity();
    return motion;
  }

  // How a point that the camera carries along moves (attached_point.cc).
  Eigen::MatrixXd PointRows(size_t camera, const Eigen::Vector3d& point_m) const {
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(3, knowledge_.size());
    const RigidTransform& pose = problem_.cameras[camera].cam_from_rig;
    const Eigen::Matrix3d back = pose.rotation.toRotationMatrix().transpose();
    const Eigen::Matrix3d turn = back * CrossProductMatrix(pose.rotation * point_m);
    for (int i = 0; i < 3; ++i) {
      const auto index = static_cast<int>(camera);
      const Eigen::Index w = knowledge_.Row({ReducedParameterKind::kRotation, index, i});
      const Eigen::Index d = knowledge_.Row({ReducedParameterKind::kTranslation, index, i});
      if (w >= 0) rows.col(w) = turn.col(i);
      if (d >= 0) rows.col(d) = -back.col(i);
    }
    return rows;
  }

  // The best rigid motion of the centres and of the places that the cameras look at.
  void FitMotion(const Eigen::Vector3d& middle_m) {
    has_motion_ = true;
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::MatrixXd right = Eigen::MatrixXd::Zero(6, knowledge_.size());
    int count = 0;
    for (size_t c = 0; c < problem_.cameras.size(); ++c) {
      if (!joined_.camera[c]) continue;
      ++count;
      for (const Eigen::Vector3d& point_m :
           {problem_.cameras[c].cam_from_rig.SourceFromTargetTranslation(), middle_m}) {
        const Eigen::Matrix<double, 3, 6> motion = MotionOf(point_m);
        normal += motion.transpose() * motion;
        right += motion.transpose() * PointRows(c, point_m);
      }
    }
    motion_known_ = count >= 2;
    if (motion_known_) motion_ = normal.ldlt().solve(right);
  }

  // Against the mean of the clocks that are seen in its session.
  bool Offset(size_t camera, Eigen::VectorXd* gain) const {
    const int own = grouped_.clock_of_camera[camera];
    if (own < 0 || !joined_.clock[static_cast<size_t>(own)]) return false;
    for (const std::vector<int>& clocks : grouped_.clocks_of_session) {
      if (std::ranges::find(clocks, own) == clocks.end()) continue;
      std::vector<int> seen;
      for (const int k : clocks) {
        if (joined_.clock[static_cast<size_t>(k)]) seen.push_back(k);
      }
      const double share = 1 / static_cast<double>(seen.size());
      for (const int k : seen) {
        const Eigen::Index row = knowledge_.Row({ReducedParameterKind::kTimeOffset, k, 0});
        if (row >= 0) (*gain)[row] += (k == own ? 1 : 0) - share;
      }
      return true;
    }
    return false;
  }

  const GroupedProblem& grouped_;
  const Knowledge& knowledge_;
  const BundleProblem& problem_;
  const Joined& joined_;
  const Eigen::Matrix3d axes_;
  bool has_motion_ = false, motion_known_ = false;
  Eigen::MatrixXd motion_;  // turn and shift, by the parameters
};

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
        wanted_(WantedOf(grouped_)) {}

  std::optional<CalibrationInformation> Run() {
    all_ = grouped_.problem;
    const Joined joined = JoinedCameras(all_);
    const auto information = ComputeInformation(BundleOptions(), all_);
    if (!information.ok()) return std::nullopt;
    const Knowledge known(*information);
    known_ = &known;
    result_.stride = static_cast<uint32_t>(grouped_.stride);
    const std::vector<double> variances = Variances(known, all_, joined);
    for (size_t p = 0; p < wanted_.size(); ++p) {
      if (!std::isfinite(variances[p])) return std::nullopt;
      const Wanted& wanted = wanted_[p];
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
  std::vector<double> Variances(const Knowledge& knowledge, const BundleProblem& problem,
                                const Joined& joined) const {
    const Gains gains(grouped_, knowledge, problem, joined, middle_m_, axes_);
    std::vector<double> variances;
    Eigen::VectorXd gain;
    for (const Wanted& wanted : wanted_) {
      variances.push_back(gains.Of(wanted, &gain) ? knowledge.Variance(gain) : kUndetermined);
    }
    return variances;
  }

  template <typename Keeps>
  void AddGroup(InformationGroup group, const Keeps& keeps, int left_out) {
    BundleProblem rest = Rest(grouped_, keeps, left_out);
    const Joined joined = JoinedCameras(rest);
    FixWhatIsSeen(grouped_, joined, &rest);
    const auto information = ComputeInformation(BundleOptions(), rest);
    std::vector<double> without(wanted_.size(), kUndetermined), with = without;
    if (information.ok()) {
      const Knowledge knowledge(*information);
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
  const std::vector<Wanted> wanted_;
  BundleProblem all_;
  const Knowledge* known_ = nullptr;
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
