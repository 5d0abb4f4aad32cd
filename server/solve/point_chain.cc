// SPDX-License-Identifier: Apache-2.0
#include "server/solve/point_chain.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/status/status_macros.h"
#include "server/solve/triangulation.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxSeeds = 50;    // pairs that are looked at for one from which all are reached
constexpr double kMinSine = 0.005;  // of the angle between two rays, for a depth to say something
constexpr double kMaxLogScale = 0.35;

using PairEstimate = std::function<absl::StatusOr<std::optional<RelativePose>>(int a, int b)>;

struct View {
  int camera;
  Eigen::Vector2d ray;
};
using PointViews = std::vector<View>;  // of one instant, one of each camera

std::vector<PointViews> AllViews(const BundleProblem& problem,
                                 const std::vector<Eigen::Vector2d>& rays) {
  std::vector<PointViews> all;
  for (const BundleInstant& instant : problem.instants) {
    PointViews views;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      if (observation.marker_count == 0) continue;
      const auto m = static_cast<size_t>(observation.first_marker);
      if (problem.markers[m].used && rays[m].allFinite()) {
        views.push_back({observation.camera, rays[m]});
      }
    }
    if (views.size() >= 2) all.push_back(std::move(views));
  }
  return all;
}

// How many instants three cameras share.
class TripleCounts {
 public:
  TripleCounts(size_t cameras, const std::vector<PointViews>& instants)
      : cameras_(cameras), counts_(cameras * cameras * cameras, 0) {
    for (const PointViews& views : instants) {
      for (const View& a : views) {
        for (const View& b : views) {
          if (b.camera <= a.camera) continue;
          for (const View& c : views) {
            if (c.camera > b.camera) ++counts_[Index(a.camera, b.camera, c.camera)];
          }
        }
      }
    }
  }
  int Of(int a, int b, int c) const {
    if (a > b) std::swap(a, b);
    if (b > c) std::swap(b, c);
    if (a > b) std::swap(a, b);
    return counts_[Index(a, b, c)];
  }

 private:
  size_t Index(int a, int b, int c) const {
    return (static_cast<size_t>(a) * cameras_ + static_cast<size_t>(b)) * cameras_ +
           static_cast<size_t>(c);
  }
  size_t cameras_;
  std::vector<int> counts_;
};

class PointChain {
 public:
  PointChain(const OverlapGraph& graph, double threshold_px,
             const std::vector<Eigen::Vector2d>& rays, const PairEstimate& estimate,
             const BundleProblem& problem)
      : graph_(graph),
        threshold_px_(threshold_px),
        problem_(problem),
        count_(static_cast<int>(problem.cameras.size())),
        estimate_(estimate),
        instants_(AllViews(problem, rays)),
        triples_(problem.cameras.size(), instants_) {}

  // cam_from_rig by camera, in the frame and the unit of the pair it began with.
  absl::StatusOr<std::vector<RigidTransform>> Run() {
    // Whether they are connected at all, in the words of every other target.
    RIGCAL_RETURN_IF_ERROR(
        FindSpanningTree(graph_, [this](int a, int b) { return Pair(a, b); }).status());
    std::vector<bool> best;
    for (const auto& [a, b] : Seeds()) {
      RIGCAL_ASSIGN_OR_RETURN(const std::vector<bool> reached, GrowFrom(a, b));
      const auto size = [](const std::vector<bool>& set) {
        return std::count(set.begin(), set.end(), true);
      };
      if (size(reached) == count_) return poses_;
      if (size(reached) > size(best)) best = reached;
    }
    return NotJoined(best);
  }

 private:
  using CameraPair = std::pair<int, int>;

  // The pose of a pair, estimated once.
  absl::StatusOr<std::optional<RelativePose>> Pair(int a, int b) {
    const auto known = pairs_.find({a, b});
    if (known != pairs_.end()) return known->second;
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<RelativePose> pose, estimate_(a, b));
    return pairs_[{a, b}] = pose;
  }

  // b_from_a in whatever order, none where the pair has no pose.
  absl::StatusOr<std::optional<RigidTransform>> FromTo(int from, int to) {
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<RelativePose> pose,
                            Pair(std::min(from, to), std::max(from, to)));
    if (!pose) return std::optional<RigidTransform>();
    return std::optional<RigidTransform>(from < to ? pose->b_from_a : pose->b_from_a.Inverse());
  }

  // A way to join camera `next`: beside camera `via`, in instants that others that are joined
  // share.
  struct Join {
    int weight = 0;
    int via = -1, next = -1;
  };

  // Instants that `via`, `next` and another camera that is joined share, at least.
  int Weight(const std::vector<bool>& joined, int via, int next) const {
    int most = 0;
    for (int a = 0; a < count_; ++a) {
      if (joined[static_cast<size_t>(a)] && a != via) {
        most = std::max(most, triples_.Of(a, via, next));
      }
    }
    return most;
  }

  Join BestJoin(const std::vector<bool>& joined, const std::set<CameraPair>& failed) const {
    Join best;
    for (int via = 0; via < count_; ++via) {
      if (!joined[static_cast<size_t>(via)]) continue;
      for (int next = 0; next < count_; ++next) {
        if (joined[static_cast<size_t>(next)] || failed.contains({via, next})) continue;
        const int weight = Weight(joined, via, next);
        if (weight >= graph_.min_shared && weight > best.weight) best = {weight, via, next};
      }
    }
    return best;
  }

  // How many cameras can be reached, as far as counts tell.
  int Reach(int a, int b) const {
    std::vector<bool> joined(static_cast<size_t>(count_), false);
    joined[static_cast<size_t>(a)] = joined[static_cast<size_t>(b)] = true;
    int size = 2;
    for (bool grown = true; grown;) {
      grown = false;
      for (int next = 0; next < count_; ++next) {
        if (joined[static_cast<size_t>(next)]) continue;
        for (int via = 0; via < count_ && !joined[static_cast<size_t>(next)]; ++via) {
          if (!joined[static_cast<size_t>(via)] || Weight(joined, via, next) < graph_.min_shared) {
            continue;
          }
          joined[static_cast<size_t>(next)] = grown = true;
          ++size;
        }
      }
    }
    return size;
  }

  // Pairs to begin with: those from which most is reached, then those that share most.
  std::vector<CameraPair> Seeds() const {
    std::vector<std::tuple<int, int, int>> pairs;  // minus shared, a, b
    for (int a = 0; a < count_; ++a) {
      for (int b = a + 1; b < count_; ++b) {
        const int shared = graph_.shared_counts[static_cast<size_t>(a)][static_cast<size_t>(b)];
        if (shared >= graph_.min_shared) pairs.emplace_back(-shared, a, b);
      }
    }
    std::sort(pairs.begin(), pairs.end());
    if (pairs.size() > kMaxSeeds) pairs.resize(kMaxSeeds);
    std::vector<std::pair<int, CameraPair>> reaches;
    for (const auto& [shared, a, b] : pairs) {
      reaches.push_back({-Reach(a, b), {a, b}});
      if (-reaches.back().first == count_ && reaches.size() >= 4) break;
    }
    std::stable_sort(reaches.begin(), reaches.end(),
                     [](const auto& left, const auto& right) { return left.first < right.first; });
    std::vector<CameraPair> seeds;
    for (const auto& [reach, pair] : reaches) seeds.push_back(pair);
    if (seeds.size() > 4) seeds.resize(4);
    return seeds;
  }

  // Joins cameras to a pair while there are any that can be. Which ones are.
  absl::StatusOr<std::vector<bool>> GrowFrom(int a, int b) {
    std::vector<bool> joined(static_cast<size_t>(count_), false);
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<RigidTransform> seed, FromTo(a, b));
    if (!seed) return joined;
    poses_.assign(static_cast<size_t>(count_), RigidTransform::Identity());
    poses_[static_cast<size_t>(b)] = *seed;
    joined[static_cast<size_t>(a)] = joined[static_cast<size_t>(b)] = true;
    std::set<CameraPair> failed;
    for (;;) {
      const Join join = BestJoin(joined, failed);
      if (join.next < 0) return joined;
      RIGCAL_ASSIGN_OR_RETURN(std::optional<RigidTransform> next_from_via,
                              FromTo(join.via, join.next));
      const std::optional<double> baseline =
          next_from_via ? Baseline(joined, join, *next_from_via) : std::nullopt;
      if (!baseline) {
        failed.insert({join.via, join.next});
        continue;
      }
      next_from_via->translation_m *= *baseline;
      poses_[static_cast<size_t>(join.next)] =
          *next_from_via * poses_[static_cast<size_t>(join.via)];
      joined[static_cast<size_t>(join.next)] = true;
    }
  }

  // The length of the baseline, from depths in camera `via`.
  std::optional<double> Baseline(const std::vector<bool>& joined, const Join& join,
                                 const RigidTransform& next_from_via) const {
    std::vector<double> log_scales;
    for (const PointViews& views : instants_) {
      const View *via = nullptr, *next = nullptr;
      std::vector<View> known;
      for (const View& view : views) {
        if (view.camera == join.via) via = &view;
        if (view.camera == join.next) next = &view;
        if (joined[static_cast<size_t>(view.camera)]) known.push_back(view);
      }
      if (via == nullptr || next == nullptr || known.size() < 2) continue;
      const std::optional<double> depth = KnownDepth(known, *via);
      const std::optional<double> unit_depth = UnitDepth(*via, *next, next_from_via);
      if (depth && unit_depth) log_scales.push_back(std::log(*depth / *unit_depth));
    }
    if (static_cast<int>(log_scales.size()) < graph_.min_shared) return std::nullopt;
    const auto middle = log_scales.begin() + static_cast<std::ptrdiff_t>(log_scales.size() / 2);
    std::nth_element(log_scales.begin(), middle, log_scales.end());
    const double median = *middle;
    const auto agree = std::count_if(log_scales.begin(), log_scales.end(), [median](double value) {
      return std::abs(value - median) < kMaxLogScale;
    });
    if (static_cast<int>(agree) < graph_.min_shared) return std::nullopt;
    return std::exp(median);
  }

  // Depth in the camera of `via` of what the joined cameras see, where they agree about it.
  std::optional<double> KnownDepth(const std::vector<View>& known, const View& via) const {
    std::vector<PointView> views;
    double sine = 0;
    const RigidTransform& via_pose = poses_[static_cast<size_t>(via.camera)];
    for (const View& view : known) {
      const RigidTransform& pose = poses_[static_cast<size_t>(view.camera)];
      views.push_back({pose, view.ray});
      sine = std::max(sine, Sine(view.ray, via.ray, pose * via_pose.Inverse()));
    }
    Eigen::Vector3d point;
    if (sine < kMinSine || !Triangulate(views, &point)) return std::nullopt;
    for (size_t i = 0; i < views.size(); ++i) {
      const IntrinsicsVector& intrinsics =
          problem_.cameras[static_cast<size_t>(known[i].camera)].intrinsics;
      const double error_px = 0.5 * (intrinsics[0] + intrinsics[1]) *
                              ((views[i].cam_from_rig * point).hnormalized() - views[i].ray).norm();
      if (!(error_px < 4 * threshold_px_)) return std::nullopt;
    }
    return (via_pose * point).z();
  }

  static std::optional<double> UnitDepth(const View& via, const View& next,
                                         const RigidTransform& next_from_via) {
    Eigen::Vector3d point;
    if (Sine(next.ray, via.ray, next_from_via) < kMinSine ||
        !TriangulatePair({RigidTransform::Identity(), via.ray}, {next_from_via, next.ray},
                         &point)) {
      return std::nullopt;
    }
    return point.z();
  }

  // Of the angle between two cameras' rays.
  static double Sine(const Eigen::Vector2d& ray_a, const Eigen::Vector2d& ray_b,
                     const RigidTransform& a_from_b) {
    const Eigen::Vector3d a = ray_a.homogeneous(), b = a_from_b.rotation * ray_b.homogeneous();
    return a.cross(b).norm() / (a.norm() * b.norm());
  }

  std::string Name(int camera) const { return graph_.cameras[static_cast<size_t>(camera)]; }

  absl::Status NotJoined(std::vector<bool> reached) const {
    reached.resize(static_cast<size_t>(count_), false);
    std::vector<std::string> inside, outside;
    std::tuple<int, int, int> best(-1, 0, 0);  // shared, minus via, minus next
    for (int via = 0; via < count_; ++via) {
      (reached[static_cast<size_t>(via)] ? inside : outside).push_back(Name(via));
      for (int next = 0; next < count_; ++next) {
        if (!reached[static_cast<size_t>(via)] || reached[static_cast<size_t>(next)]) continue;
        best = std::max(
            best, {graph_.shared_counts[static_cast<size_t>(via)][static_cast<size_t>(next)], -via,
                   -next});
      }
    }
    if (inside.size() < 2) {
      return absl::FailedPreconditionError(
          "no two cameras agree on a relative pose from which the others could be placed: move the "
          "marker through all of what they see, near and far");
    }
    const int via = -std::get<1>(best), next = -std::get<2>(best);
    int third = -1, shared = -1;
    for (int a = 0; a < count_; ++a) {
      const int both = graph_.shared_counts[static_cast<size_t>(a)][static_cast<size_t>(via)];
      if (a == via || !reached[static_cast<size_t>(a)] || both <= shared) continue;
      third = a;
      shared = both;
    }
    return absl::FailedPreconditionError(absl::StrCat(
        "the scale cannot be carried from the cameras {", absl::StrJoin(inside, ", "), "} to {",
        absl::StrJoin(outside, ", "),
        "}: with one marker it takes moments that three cameras "
        "share, and ",
        Name(via), " and ", Name(next), " share ", std::get<0>(best), " moments but only ",
        Weight(reached, via, next), " with one of the others as well that can be used (at least ",
        graph_.min_shared, " are needed); wave the marker where ", Name(third), ", ", Name(via),
        " and ", Name(next), " see it at the same time, or use a wand with two or more markers"));
  }

  const OverlapGraph& graph_;
  const double threshold_px_;
  const BundleProblem& problem_;
  const int count_;
  const PairEstimate& estimate_;
  const std::vector<PointViews> instants_;
  const TripleCounts triples_;
  std::map<CameraPair, std::optional<RelativePose>> pairs_;
  std::vector<RigidTransform> poses_;
};

Eigen::Vector3d Centre(const RigidTransform& cam_from_rig) {
  return cam_from_rig.SourceFromTargetTranslation();
}

// Puts the poses into the fixed camera's frame and gives them their unit.
absl::Status Adopt(const std::vector<RigidTransform>& poses, BundleProblem* problem) {
  size_t fixed = 0;
  while (!problem->cameras[fixed].pose_fixed) ++fixed;
  const RigidTransform kept = problem->cameras[fixed].cam_from_rig;
  double farthest = -1;
  int unit_camera = -1;
  for (size_t c = 0; c < poses.size(); ++c) {
    const double away = (Centre(poses[c]) - Centre(poses[fixed])).norm();
    if (c == fixed || away <= farthest) continue;
    farthest = away;
    unit_camera = static_cast<int>(c);
  }
  if (!problem->distance) {
    problem->distance = BundleDistance{static_cast<int>(fixed), unit_camera, 1};
  }
  const BundleDistance& distance = *problem->distance;
  const double length = (Centre(poses[static_cast<size_t>(distance.camera_b)]) -
                         Centre(poses[static_cast<size_t>(distance.camera_a)]))
                            .norm();
  if (!(length > 1e-6 * farthest)) {
    return absl::FailedPreconditionError(absl::StrCat(
        "cameras ", problem->cameras[static_cast<size_t>(distance.camera_a)].name, " and ",
        problem->cameras[static_cast<size_t>(distance.camera_b)].name,
        " are in one place as far as the images tell: their distance cannot give the scale"));
  }
  const double unit = distance.distance_m / length;
  const RigidTransform fixed_from_start = poses[fixed].Inverse();
  for (size_t c = 0; c < poses.size(); ++c) {
    if (c == fixed) continue;
    RigidTransform from_fixed = poses[c] * fixed_from_start;
    from_fixed.translation_m *= unit;
    problem->cameras[c].cam_from_rig = from_fixed * kept;
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status ChainPointPoses(const OverlapGraph& graph, double threshold_px,
                             const std::vector<Eigen::Vector2d>& rays, const PairEstimate& estimate,
                             BundleProblem* problem) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<RigidTransform> poses,
                          PointChain(graph, threshold_px, rays, estimate, *problem).Run());
  return Adopt(poses, problem);
}

}  // namespace rigcal::server
