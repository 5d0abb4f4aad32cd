// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/path_comparison.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/statistics/robust_statistics.h"
#include "tests/accuracy/rig/statistics.h"

namespace rigcal::accuracy {
namespace {

constexpr size_t kMinPositions = 10;
constexpr size_t kSearchedPositions = 50;
constexpr double kMinShare = 0.9;  // of the positions within the reference's time
// Steps of the search for the time's scale and offset: the first, and where it ends.
constexpr double kScaleStep = 1e-4, kOffsetStepS = 0.1;
constexpr double kFinest = 1e-4;  // of the first

struct TimeMap {
  double scale = 1, offset_s = 0;
};

std::optional<Eigen::Vector3d> ReferenceAt(const ReferencePath& reference, double time_s) {
  const double row = time_s * reference.rate_hz;
  if (!(row >= 1) || row + 3 > static_cast<double>(reference.positions_m.size())) {
    return std::nullopt;
  }
  const auto i = static_cast<size_t>(row);
  const double u = row - static_cast<double>(i);
  const Eigen::Vector3d* p = &reference.positions_m[i - 1];
  return 0.5 * (2 * p[1] + u * (p[2] - p[0]) + u * u * (2 * p[0] - 5 * p[1] + 4 * p[2] - p[3]) +
                u * u * u * (3 * p[1] - p[0] - 3 * p[2] + p[3]));
}

// Distances after the best alignment; none where the reference does not cover the path.
std::vector<double> Distances(const std::vector<TimedPosition>& path,
                              const ReferencePath& reference, const PathFreedom& freedom,
                              const TimeMap& map) {
  Eigen::Matrix3Xd from(3, path.size()), to(3, path.size());
  Eigen::Index count = 0;
  for (const TimedPosition& position : path) {
    const auto there =
        ReferenceAt(reference, map.scale * (position.time_s - path.front().time_s) + map.offset_s);
    if (!there) continue;
    from.col(count) = position.position;
    to.col(count++) = *there;
  }
  if (static_cast<double>(count) < kMinShare * static_cast<double>(path.size())) return {};
  from.conservativeResize(3, count);
  to.conservativeResize(3, count);
  const Eigen::Matrix4d similarity = Eigen::umeyama(from, to, freedom.length_scale);
  const Eigen::Matrix3Xd moved =
      (similarity.topLeftCorner<3, 3>() * from).colwise() + similarity.topRightCorner<3, 1>();
  const Eigen::VectorXd distances = (moved - to).colwise().norm().transpose();
  return {distances.data(), distances.data() + count};
}

double RmsOf(const std::vector<TimedPosition>& path, const ReferencePath& reference,
             const PathFreedom& freedom, const TimeMap& map) {
  const std::vector<double> distances = Distances(path, reference, freedom, map);
  return distances.empty() ? std::numeric_limits<double>::infinity() : RootMeanSquare(distances);
}

// From every row of the reference.
TimeMap SearchOffset(const std::vector<TimedPosition>& path, const ReferencePath& reference,
                     const PathFreedom& freedom) {
  std::vector<TimedPosition> some;
  for (size_t i = 0; i < path.size(); i += 1 + path.size() / kSearchedPositions) {
    some.push_back(path[i]);
  }
  TimeMap best;
  double least_m = std::numeric_limits<double>::infinity();
  for (size_t row = 0; row < reference.positions_m.size(); ++row) {
    const TimeMap map = {1, static_cast<double>(row) / reference.rate_hz};
    const double rms_m = RmsOf(some, reference, freedom, map);
    if (rms_m < least_m) least_m = rms_m, best = map;
  }
  return best;
}

// Downhill by ever smaller steps. The scale turns about the path's middle, where it is independent
// of the offset.
TimeMap Refine(const std::vector<TimedPosition>& path, const ReferencePath& reference,
               const PathFreedom& freedom, TimeMap map) {
  const double middle_s = 0.5 * (path.back().time_s - path.front().time_s);
  double least_m = RmsOf(path, reference, freedom, map);
  for (double share = 1; share > kFinest;) {
    bool moved = false;
    for (const auto& [scale, offset_s] :
         {std::pair(kScaleStep, -kScaleStep * middle_s),
          std::pair(-kScaleStep, kScaleStep * middle_s), std::pair(0.0, kOffsetStepS),
          std::pair(0.0, -kOffsetStepS)}) {
      if (scale != 0 && !freedom.time_scale) continue;
      const TimeMap other = {map.scale + share * scale, map.offset_s + share * offset_s};
      const double rms_m = RmsOf(path, reference, freedom, other);
      if (!(rms_m < least_m)) continue;
      least_m = rms_m;
      map = other;
      moved = true;
      break;
    }
    if (!moved) share *= 0.5;
  }
  return map;
}

}  // namespace

absl::StatusOr<ReferencePath> LoadReferencePath(const std::filesystem::path& file, double rate_hz) {
  std::ifstream in(file);
  if (!in) return absl::NotFoundError(absl::StrCat("cannot read ", file.string()));
  ReferencePath path;
  path.rate_hz = rate_hz;
  for (Eigen::Vector3d row; in >> row[0] >> row[1] >> row[2];) path.positions_m.push_back(row);
  if (!in.eof() || path.positions_m.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(file.string(), ": no three numbers after row ", path.positions_m.size()));
  }
  return path;
}

absl::StatusOr<PathErrors> ComparePaths(const std::vector<TimedPosition>& path,
                                        const ReferencePath& reference,
                                        const PathFreedom& freedom) {
  if (path.size() < kMinPositions) {
    return absl::FailedPreconditionError(absl::StrCat("a path of ", path.size(), " positions"));
  }
  const TimeMap map = Refine(path, reference, freedom, SearchOffset(path, reference, freedom));
  const std::vector<double> distances = Distances(path, reference, freedom, map);
  if (distances.empty()) {
    return absl::FailedPreconditionError("the reference path is shorter than the path");
  }
  PathErrors errors;
  errors.count = distances.size();
  errors.mean_m = Mean(distances);
  errors.rms_m = RootMeanSquare(distances);
  errors.median_m = Median(distances);
  errors.time_scale = map.scale;
  errors.time_offset_s = map.offset_s;
  return errors;
}

}  // namespace rigcal::accuracy
