// SPDX-License-Identifier: Apache-2.0
#include "common/lens/next_view.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/camera/camera_model.h"
#include "common/lens/lens_adjustment.h"
#include "common/lens/lens_uncertainty.h"

namespace rigcal {
namespace {

// How much of the image's width or height the board spans where it faces the camera in the middle.
struct Distance {
  const char* words;
  double span;
};
constexpr std::array<Distance, 2> kDistances = {{{"near", 0.65}, {"far", 0.4}}};
constexpr std::array<double, 2> kTiltsDeg = {30, 45};
constexpr int kTiltDirections = 8;  // from the right side of the image on, clockwise
constexpr std::array<const char*, kTiltDirections> kTiltedSides = {
    "right side", "lower right corner", "lower side", "lower left corner",
    "left side",  "upper left corner",  "upper side", "upper right corner"};

constexpr double kMargin = 0.03;     // of the image, that a whole board keeps from its border
constexpr double kPartMiddle = 0.2;  // of the image, from its border to the middle of a part
constexpr double kLeastPart = 0.4;   // of the points of a board that need not be whole
constexpr size_t kMostPoints = 64;   // that stand for those of a large board
constexpr int kPlacingSteps = 6;
constexpr double kNearest = 0.05, kFarthest = 100;  // of the board's diagonal
constexpr double kSameRay = 1e-3;
constexpr size_t kLeastViewCorners = 3;

// Where the board's middle is: -1 left or up, 0, 1 right or down.
struct Place {
  int x = 0, y = 0;
};

std::string PlaceWords(const Place& place) {
  if (place.x == 0 && place.y == 0) return "in the middle";
  const char* vertical = place.y < 0 ? "upper" : "lower";
  const char* horizontal = place.x < 0 ? "left" : "right";
  if (place.x == 0) return place.y < 0 ? "at the top" : "at the bottom";
  if (place.y == 0) return absl::StrCat("at the ", horizontal);
  return absl::StrCat("at the ", vertical, " ", horizontal);
}

// `side` of kTiltedSides.
std::string Words(const Place& place, const char* distance, int side, double tilt_deg) {
  const std::string start = absl::StrCat("hold the board ", PlaceWords(place), ", ", distance);
  if (tilt_deg == 0) return start + ", facing the camera";
  return absl::StrFormat("%s, with its %s turned away from the camera by about %.0f degrees", start,
                         kTiltedSides[static_cast<size_t>(side)], tilt_deg);
}

// What a person does who has no lens yet.
std::string FirstWords(size_t views) {
  struct First {
    Place place;
    int side;
  };
  static constexpr std::array<First, 8> kFirst = {{{{0, 0}, 4},
                                                   {{0, 0}, 0},
                                                   {{0, 0}, 6},
                                                   {{0, 0}, 2},
                                                   {{-1, -1}, 0},
                                                   {{1, 1}, 4},
                                                   {{1, -1}, 2},
                                                   {{-1, 1}, 6}}};
  const First& first = kFirst[views % kFirst.size()];
  return Words(first.place, kDistances[0].words, first.side, kTiltsDeg[0]);
}

// The corners of the points' convex hull, counterclockwise in frame `board`.
std::vector<Eigen::Vector3d> HullOf(std::vector<Eigen::Vector3d> points) {
  std::sort(points.begin(), points.end(), [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  std::vector<Eigen::Vector3d> hull;
  for (int side = 0; side < 2; ++side) {  // below, then above
    const size_t first = hull.size();
    for (const Eigen::Vector3d& point : points) {
      while (hull.size() >= first + 2) {
        const Eigen::Vector3d& last = hull.back();
        const Eigen::Vector3d& before = hull[hull.size() - 2];
        if ((last - before).cross(point - before).z() > 0) break;
        hull.pop_back();
      }
      hull.push_back(point);
    }
    hull.pop_back();  // it begins the other side
    std::reverse(points.begin(), points.end());
  }
  return hull;
}

// Of a board that is held upright and faces the camera, rotated as a person holds it: by quarter
// turns, and with its pattern to the camera.
Eigen::Quaterniond FacingRotation(const std::vector<BoardView>& views) {
  for (auto view = views.rbegin(); view != views.rend(); ++view) {
    if (view->corners.size() < kLeastViewCorners) continue;
    // pixel = affine * x_in_board + offset
    Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
    Eigen::Matrix<double, 2, 3> products = Eigen::Matrix<double, 2, 3>::Zero();
    for (const BoardCorner& corner : view->corners) {
      const Eigen::Vector3d at(corner.x_in_board_m.x(), corner.x_in_board_m.y(), 1);
      squares += at * at.transpose();
      products += corner.pixel * at.transpose();
    }
    const Eigen::LDLT<Eigen::Matrix3d> factor(squares);
    const Eigen::Matrix<double, 2, 3> affine = factor.solve(products.transpose()).transpose();
    const double area = affine.leftCols<2>().determinant();
    if (!affine.allFinite() || area == 0) continue;
    const double quarter = 0.5 * std::numbers::pi;
    const double roll = quarter * std::round(std::atan2(affine(1, 0), affine(0, 0)) / quarter);
    const Eigen::Quaterniond turned(Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()));
    if (area > 0) return turned;
    // Its z points to the camera.
    return turned * Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX());
  }
  return Eigen::Quaterniond::Identity();
}

struct Box {
  Eigen::Vector2d low, high;
};

// What a lens shows of a board that is somewhere.
class BoardInImage {
 public:
  BoardInImage(const std::vector<Eigen::Vector3d>& points_m, const Intrinsics& lens,
               const ImageSize& image_size_px)
      : points_m_(points_m), hull_m_(HullOf(points_m)), lens_(lens) {
    border_px_ = {image_size_px.width - 1.0, image_size_px.height - 1.0};
    for (const Eigen::Vector3d& point : points_m) {
      middle_m_ += point / static_cast<double>(points_m.size());
    }
    for (const Eigen::Vector3d& point : points_m) {
      size_m_ = std::max(size_m_, 2 * (point - middle_m_).norm());
    }
  }

  const Eigen::Vector2d& border_px() const { return border_px_; }

  // Facing whoever looks from the camera, then turned.
  std::optional<RigidTransform> PoseAt(const Eigen::Vector2d& pixel, double distance_m,
                                       const Eigen::Quaterniond& turned) const {
    const absl::StatusOr<Eigen::Vector2d> ray = Undistort(lens_, pixel);
    if (!ray.ok()) return std::nullopt;
    const Eigen::Vector3d direction = Eigen::Vector3d(ray->x(), ray->y(), 1).normalized();
    RigidTransform pose;
    pose.rotation =
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), direction) * turned;
    pose.translation_m = distance_m * direction - pose.rotation * middle_m_;
    return pose;
  }

  // Of the hull. None: a corner of it is not seen.
  std::optional<std::vector<Eigen::Vector2d>> Outline(const RigidTransform& pose) const {
    std::vector<Eigen::Vector2d> outline;
    for (const Eigen::Vector3d& point : hull_m_) {
      Eigen::Vector2d pixel;
      if (!Project(lens_, pose * point, &pixel)) return std::nullopt;
      outline.push_back(pixel);
    }
    return outline;
  }

  // Beyond the part in which a model is monotone, a point has a pixel that is not its own.
  bool IsTrue(const RigidTransform& pose, const std::vector<Eigen::Vector2d>& outline) const {
    for (size_t i = 0; i < outline.size(); ++i) {
      const absl::StatusOr<Eigen::Vector2d> ray = Undistort(lens_, outline[i]);
      const Eigen::Vector3d point = pose * hull_m_[i];
      if (!ray.ok() || (*ray - point.head<2>() / point.z()).norm() > kSameRay) return false;
    }
    return true;
  }

  // The distance at which the board spans that share of the image, in the middle.
  std::optional<double> DistanceFor(double span, const Eigen::Quaterniond& facing) const {
    double near = kNearest * size_m_, far = kFarthest * size_m_;
    while (far > 1.01 * near) {
      const double between = std::sqrt(near * far);
      const std::optional<RigidTransform> pose = PoseAt(0.5 * border_px_, between, facing);
      if (!pose) return std::nullopt;
      const auto outline = Outline(*pose);
      bool is_small = false;
      if (outline) {
        const Box box = BoxOf(*outline);
        is_small = ((box.high - box.low).array() / border_px_.array()).maxCoeff() < span;
      }
      (is_small ? far : near) = between;
    }
    return far;
  }

  // At a place of the image: as far to that side as the board may be. None: it does not fit.
  std::optional<RigidTransform> PoseAtPlace(const Place& place, double distance_m,
                                            const Eigen::Quaterniond& turned, bool is_whole) const {
    const Eigen::Vector2d low = kMargin * border_px_, high = border_px_ - low;
    Eigen::Vector2d pixel = 0.5 * border_px_;
    for (int axis = 0; axis < 2; ++axis) {
      const int side = axis == 0 ? place.x : place.y;
      pixel[axis] += side * (0.5 - kPartMiddle) * border_px_[axis];
    }
    for (int step = 0;; ++step) {
      const std::optional<RigidTransform> pose = PoseAt(pixel, distance_m, turned);
      if (!pose) return std::nullopt;
      const auto outline = Outline(*pose);
      if (!outline) return std::nullopt;
      const Box box = BoxOf(*outline);
      if (step == kPlacingSteps) {
        const bool is_in =
            (box.low.array() >= 0).all() && (box.high.array() <= border_px_.array()).all();
        if (is_whole && !(is_in && IsTrue(*pose, *outline))) return std::nullopt;
        return pose;
      }
      for (int axis = 0; axis < 2; ++axis) {
        const int side = axis == 0 ? place.x : place.y;
        double move = 0.5 * (low[axis] + high[axis] - box.low[axis] - box.high[axis]);
        if (side < 0) move = low[axis] - box.low[axis];
        if (side > 0) move = high[axis] - box.high[axis];
        if (!is_whole && side != 0) move = 0;
        pixel[axis] = std::clamp(pixel[axis] + move, 0.0, border_px_[axis]);
      }
    }
  }

  // What would be seen.
  BoardView Seen(const RigidTransform& pose) const {
    BoardView view;
    for (const Eigen::Vector3d& point : points_m_) {
      Eigen::Vector2d pixel;
      if (!Project(lens_, pose * point, &pixel)) continue;
      if ((pixel.array() < 0).any() || (pixel.array() > border_px_.array()).any()) continue;
      view.corners.push_back({point, pixel});
    }
    return view;
  }

 private:
  static Box BoxOf(const std::vector<Eigen::Vector2d>& outline) {
    Box box{outline[0], outline[0]};
    for (const Eigen::Vector2d& pixel : outline) {
      box.low = box.low.cwiseMin(pixel);
      box.high = box.high.cwiseMax(pixel);
    }
    return box;
  }

  std::vector<Eigen::Vector3d> points_m_, hull_m_;
  const Intrinsics& lens_;
  Eigen::Vector2d border_px_ = Eigen::Vector2d::Zero();
  Eigen::Vector3d middle_m_ = Eigen::Vector3d::Zero();
  double size_m_ = 0;
};

}  // namespace

NextView AdviseNextView(const std::vector<Eigen::Vector3d>& points_m,
                        const ImageSize& image_size_px, const std::vector<BoardView>& views,
                        const LensSolution* solution, bool is_whole) {
  NextView next;
  next.words = FirstWords(views.size());
  if (solution == nullptr || CovarianceOf(solution->information).size() == 0) return next;
  // A part of a large board's points stands for all of them.
  const size_t stride = (points_m.size() + kMostPoints - 1) / kMostPoints;
  std::vector<Eigen::Vector3d> some_m;
  for (size_t i = 0; i < points_m.size(); i += stride) some_m.push_back(points_m[i]);
  const double weight = static_cast<double>(points_m.size()) / static_cast<double>(some_m.size());

  const BoardInImage whole(points_m, solution->intrinsics, image_size_px);
  const BoardInImage some(some_m, solution->intrinsics, image_size_px);
  const LensSensitivity sensitivity(solution->model, solution->intrinsics, image_size_px);
  const Eigen::Quaterniond facing = FacingRotation(views);
  const double variance_px2 = std::pow(std::max(solution->noise_px, kLeastNoisePx), 2);
  double least = std::numeric_limits<double>::infinity();
  for (const Distance& distance : kDistances) {
    const std::optional<double> distance_m = whole.DistanceFor(distance.span, facing);
    if (!distance_m) continue;
    for (int turn = 0; turn <= kTiltDirections * static_cast<int>(kTiltsDeg.size()); ++turn) {
      const int side = turn % kTiltDirections;
      const double tilt_deg = turn == kTiltDirections * static_cast<int>(kTiltsDeg.size())
                                  ? 0
                                  : kTiltsDeg[static_cast<size_t>(turn / kTiltDirections)];
      const double towards = 2 * std::numbers::pi * side / kTiltDirections;
      const Eigen::Vector3d away(std::cos(towards), std::sin(towards), 0);
      const Eigen::Quaterniond turned = Eigen::AngleAxisd(tilt_deg * std::numbers::pi / 180,
                                                          away.cross(Eigen::Vector3d::UnitZ())) *
                                        facing;
      for (int place_index = 0; place_index < (is_whole ? 9 : 18); ++place_index) {
        const Place place{place_index % 3 - 1, place_index / 3 % 3 - 1};
        const auto pose = whole.PoseAtPlace(place, *distance_m, turned, place_index < 9);
        if (!pose) continue;
        const BoardView seen = some.Seen(*pose);
        const auto all = static_cast<double>(some_m.size());
        if (static_cast<double>(seen.corners.size()) < (is_whole ? 1 : kLeastPart) * all) continue;
        LensAdjustmentOptions no_steps;
        no_steps.max_steps = 0;
        const LensAdjustment alone = AdjustLens({seen},
                                                {.model = solution->model,
                                                 .intrinsics = solution->intrinsics,
                                                 .cam_from_board = {*pose}},
                                                no_steps);
        const Eigen::MatrixXd covariance =
            CovarianceOf(solution->information + weight / variance_px2 * alone.information);
        const double variance = sensitivity.MeanVariance(covariance);
        if (!(variance < least)) continue;
        least = variance;
        next.words = Words(place, distance.words, side, tilt_deg);
        next.cam_from_board = *pose;
        next.outline_px = *whole.Outline(*pose);
        next.expected_p95_px = sensitivity.Of(covariance).p95_px;
      }
    }
  }
  return next;
}

}  // namespace rigcal
