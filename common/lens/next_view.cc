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

constexpr double kNearSpan = 0.65;     // of the image's width or height
constexpr double kNearestShare = 0.6;  // of the board's diagonal; nearer, cameras are out of focus
constexpr double kFarRatio = 1.6;      // of the near distance
constexpr std::array<double, 2> kTiltsDeg = {30, 45};
constexpr int kTiltDirections = 8;  // from the right side of the image on, clockwise
constexpr std::array<const char*, kTiltDirections> kTiltedSides = {
    "right side", "lower right corner", "lower side", "lower left corner",
    "left side",  "upper left corner",  "upper side", "upper right corner"};

constexpr int kPlaces = 9;           // 3 x 3
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

NextView Held(const Place& place, bool is_near, double tilt_deg, int side) {
  NextView next;
  next.place_x = place.x;
  next.place_y = place.y;
  next.is_near = is_near;
  next.tilt_deg = tilt_deg;
  next.towards_deg = 360.0 * side / kTiltDirections;
  next.words = absl::StrCat("hold the board ", PlaceWords(place), is_near ? ", near" : ", far");
  if (tilt_deg == 0) {
    next.words += ", facing the camera";
  } else {
    absl::StrAppendFormat(&next.words,
                          ", with its %s turned away from the camera by about %.0f degrees",
                          kTiltedSides[static_cast<size_t>(side)], tilt_deg);
  }
  return next;
}

// For whom has no lens yet.
NextView FirstView(size_t views) {
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
  return Held(first.place, true, kTiltsDeg[0], first.side);
}

// Of a board that faces the camera, turned as `next` says.
Eigen::Quaterniond Turned(const NextView& next, const Eigen::Quaterniond& facing) {
  const double towards = next.towards_deg * std::numbers::pi / 180;
  const Eigen::Vector3d away(std::cos(towards), std::sin(towards), 0);
  return Eigen::AngleAxisd(next.tilt_deg * std::numbers::pi / 180,
                           away.cross(Eigen::Vector3d::UnitZ())) *
         facing;
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

  bool IsInside(const RigidTransform& pose) const {
    const auto outline = Outline(pose);
    if (!outline) return false;
    const Box box = BoxOf(*outline);
    return (box.low.array() >= kMargin * border_px_.array()).all() &&
           (box.high.array() <= (1 - kMargin) * border_px_.array()).all() && IsTrue(pose, *outline);
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

  // None: the lens does not show the middle of the image.
  std::optional<double> DistanceFor(bool is_near, const Eigen::Quaterniond& facing) const {
    double near = kNearest * size_m_, far = kFarthest * size_m_;
    while (far > 1.01 * near) {
      const double between = std::sqrt(near * far);
      const std::optional<RigidTransform> pose = PoseAt(0.5 * border_px_, between, facing);
      if (!pose) return std::nullopt;
      const auto outline = Outline(*pose);
      bool is_small = false;
      if (outline) {
        const Box box = BoxOf(*outline);
        is_small = ((box.high - box.low).array() / border_px_.array()).maxCoeff() < kNearSpan;
      }
      (is_small ? far : near) = between;
    }
    return (is_near ? 1 : kFarRatio) * std::max(far, kNearestShare * size_m_);
  }

  // At a place of the image: all of it, as far to that side as it may be; or a part of it, its
  // middle beside the border. None: it does not fit.
  std::optional<RigidTransform> PoseAtPlace(const Place& place, double distance_m,
                                            const Eigen::Quaterniond& turned, bool is_whole) const {
    const Eigen::Vector2d side(place.x, place.y);
    const auto at = [&](const Eigen::Vector2d& share) {
      const Eigen::Vector2d pixel =
          (0.5 * border_px_.array() * (1 + side.array() * share.array())).matrix();
      return PoseAt(pixel, distance_m, turned);
    };
    if (!is_whole) {
      const auto pose = at(Eigen::Vector2d::Constant(1 - 2 * kPartMiddle));
      return pose && Outline(*pose) ? pose : std::nullopt;
    }
    const auto fits = [&](const Eigen::Vector2d& share) {
      const auto pose = at(share);
      return pose && IsInside(*pose);
    };
    // To both sides alike, then to each as far as there is room.
    Eigen::Vector2d share = Eigen::Vector2d::Zero();
    if (!fits(share)) return std::nullopt;
    for (const Eigen::Vector2d& step :
         {Eigen::Vector2d(1, 1), Eigen::Vector2d(1, 0), Eigen::Vector2d(0, 1)}) {
      if (step.cwiseProduct(side).isZero()) continue;
      double low = 0, high = 1;
      for (int i = 0; i < kPlacingSteps; ++i) {
        const double between = 0.5 * (low + high);
        (fits((share + between * step).cwiseMin(1)) ? low : high) = between;
      }
      share = (share + low * step).cwiseMin(1);
    }
    return at(share);
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

std::optional<RigidTransform> PoseOf(const NextView& next,
                                     const std::vector<Eigen::Vector3d>& points_m,
                                     const Intrinsics& lens, const ImageSize& image_size_px,
                                     const std::vector<BoardView>& views, bool is_whole) {
  const BoardInImage board(points_m, lens, image_size_px);
  const Eigen::Quaterniond facing = FacingRotation(views);
  const std::optional<double> distance_m = board.DistanceFor(next.is_near, facing);
  if (!distance_m) return std::nullopt;
  return board.PoseAtPlace({next.place_x, next.place_y}, *distance_m, Turned(next, facing),
                           is_whole);
}

NextView AdviseNextView(const std::vector<Eigen::Vector3d>& points_m,
                        const ImageSize& image_size_px, const std::vector<BoardView>& views,
                        const LensSolution* solution, bool is_whole) {
  NextView best = FirstView(views.size());
  if (solution == nullptr || CovarianceOf(solution->information).size() == 0) return best;
  // A part of a large board's points stands for all of them.
  const size_t stride = (points_m.size() + kMostPoints - 1) / kMostPoints;
  std::vector<Eigen::Vector3d> some_m;
  for (size_t i = 0; i < points_m.size(); i += stride) some_m.push_back(points_m[i]);
  const auto some_count = static_cast<double>(some_m.size());
  const double variance_px2 = std::pow(std::max(solution->noise_px, kLeastNoisePx), 2);
  const double weight = static_cast<double>(points_m.size()) / some_count / variance_px2;

  const BoardInImage whole(points_m, solution->intrinsics, image_size_px);
  const BoardInImage some(some_m, solution->intrinsics, image_size_px);
  const LensSensitivity sensitivity(solution->model, solution->intrinsics, image_size_px);
  const Eigen::Quaterniond facing = FacingRotation(views);
  LensAdjustmentOptions no_steps;
  no_steps.max_steps = 0;
  double least = std::numeric_limits<double>::infinity();
  const auto consider = [&](NextView next, double distance_m, bool fits) {
    const auto pose =
        whole.PoseAtPlace({next.place_x, next.place_y}, distance_m, Turned(next, facing), fits);
    if (!pose) return;
    const BoardView seen = some.Seen(*pose);
    const double least_seen = fits ? some_count : kLeastPart * some_count;
    if (static_cast<double>(seen.corners.size()) < least_seen) return;
    const LensAdjustment alone = AdjustLens(
        {seen},
        {.model = solution->model, .intrinsics = solution->intrinsics, .cam_from_board = {*pose}},
        no_steps);
    const Eigen::MatrixXd covariance =
        CovarianceOf(solution->information + weight * alone.information);
    const double variance = sensitivity.MeanVariance(covariance);
    if (!(variance < least)) return;
    least = variance;
    best = std::move(next);
    best.cam_from_board = *pose;
    best.outline_px = *whole.Outline(*pose);
    best.expected_p95_px = sensitivity.Of(covariance).p95_px;
  };
  for (const bool is_near : {true, false}) {
    const std::optional<double> distance_m = whole.DistanceFor(is_near, facing);
    if (!distance_m) continue;
    for (int at = 0; at < kPlaces; ++at) {
      const Place place{at % 3 - 1, at / 3 - 1};
      for (const bool fits : {true, false}) {
        if (!fits && is_whole) continue;
        consider(Held(place, is_near, 0, 0), *distance_m, fits);
        for (const double tilt_deg : kTiltsDeg) {
          for (int side = 0; side < kTiltDirections; ++side) {
            consider(Held(place, is_near, tilt_deg, side), *distance_m, fits);
          }
        }
      }
    }
  }
  return best;
}

}  // namespace rigcal
