// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/board_renderer.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "common/board/marker_cells.h"
#include "common/camera/camera_model.h"

namespace rigcal {
namespace {

constexpr int kSubpixels = 4;  // along each side of a pixel
constexpr int kRayStep = 2;    // pixels
constexpr float kInk = 35, kPaperWhite = 215, kGround = 120;
constexpr double kCircleRadius = 0.275;  // of the distance of nearest neighbours, as printed

float ColourOf(const Board& board, const Eigen::Vector3f& at) {
  const float s = static_cast<float>(board.spacing_m);
  const bool is_asymmetric = board.kind == BoardKind::kCircles;
  const float wide = static_cast<float>(is_asymmetric ? 2 * board.columns - 1 : board.columns - 1);
  const float high = static_cast<float>(board.rows - 1);
  const float x = at.x() / s, y = at.y() / s;
  if (x < -2 || y < -2 || x > wide + 2 || y > high + 2) return kGround;
  if (board.kind == BoardKind::kChecker) {
    if (x < -1 || y < -1 || x > wide + 1 || y > high + 1) return kPaperWhite;
    const int column = static_cast<int>(std::floor(x)), row = static_cast<int>(std::floor(y));
    return (column + row) % 2 == 0 ? kInk : kPaperWhite;
  }
  const float radius = static_cast<float>(kCircleRadius * (is_asymmetric ? std::sqrt(2.0) : 1.0));
  const int row = static_cast<int>(std::lround(y));
  for (int r = std::max(0, row - 1); r <= std::min(board.rows - 1, row + 1); ++r) {
    const float shift = is_asymmetric ? static_cast<float>(r % 2) : 0;
    const float pitch = is_asymmetric ? 2 : 1;
    const float column = std::round((x - shift) / pitch);
    if (column < 0 || column > static_cast<float>(board.columns - 1)) continue;
    if (std::hypot(x - shift - pitch * column, y - static_cast<float>(r)) < radius) return kInk;
  }
  return kPaperWhite;
}

// The pattern of a board with markers, for quick look-up of its black cells.
class MarkerPattern {
 public:
  MarkerPattern(const Board& board, BoardSide side) : board_(board) {
    cells_ = MarkerCells(board, side);
    pitch_m_ = cells_[0].side_m;
    for (const BlackCell& cell : cells_) pitch_m_ = std::min(pitch_m_, cell.side_m);
    for (const BlackCell& cell : cells_) {
      width_m_ = std::max(width_m_, cell.x_m + cell.side_m);
      height_m_ = std::max(height_m_, cell.y_m + cell.side_m);
    }
    columns_ = static_cast<int>(width_m_ / pitch_m_) + 2;
    rows_ = static_cast<int>(height_m_ / pitch_m_) + 2;
    buckets_.resize(static_cast<size_t>(columns_ * rows_));
    for (size_t i = 0; i < cells_.size(); ++i) {
      const BlackCell& cell = cells_[i];
      for (int row = Bucket(cell.y_m); row <= Bucket(cell.y_m + cell.side_m); ++row) {
        for (int column = Bucket(cell.x_m); column <= Bucket(cell.x_m + cell.side_m); ++column) {
          buckets_[static_cast<size_t>(row * columns_ + column)].push_back(i);
        }
      }
    }
  }

  // At a point of frame `board`.
  float ColourAt(const Eigen::Vector3f& at) const {
    const bool is_april = board_.kind == BoardKind::kAprilGrid;
    const double gap_m = is_april ? board_.gap_share * board_.spacing_m : board_.spacing_m;
    const double x = at.x() + gap_m, y = is_april ? height_m_ - gap_m - at.y() : at.y() + gap_m;
    const double margin_m = board_.spacing_m;
    if (x < -margin_m || y < -margin_m || x > width_m_ + margin_m || y > height_m_ + margin_m) {
      return kGround;
    }
    if (x < 0 || y < 0 || x > width_m_ || y > height_m_) return kPaperWhite;
    for (const size_t i : buckets_[static_cast<size_t>(Bucket(y) * columns_ + Bucket(x))]) {
      const BlackCell& cell = cells_[i];
      if (x >= cell.x_m && y >= cell.y_m && x < cell.x_m + cell.side_m &&
          y < cell.y_m + cell.side_m) {
        return kInk;
      }
    }
    return kPaperWhite;
  }

 private:
  int Bucket(double metres) const { return static_cast<int>(metres / pitch_m_); }

  const Board board_;
  std::vector<BlackCell> cells_;
  double pitch_m_ = 0, width_m_ = 0, height_m_ = 0;
  int columns_ = 0, rows_ = 0;
  std::vector<std::vector<size_t>> buckets_;
};

}  // namespace

BoardRenderer::BoardRenderer(const Intrinsics& lens, const ImageSize& image)
    : lens_(lens), image_(image) {
  columns_ = static_cast<int>(image.width) / kRayStep + 2;
  rows_ = static_cast<int>(image.height) / kRayStep + 2;
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      // One step further than the image's corner; the first table entry is at pixel -1.
      const auto ray = Undistort(lens, Eigen::Vector2d(column * kRayStep - 1, row * kRayStep - 1));
      rays_.push_back(ray.ok() ? Eigen::Vector3d(ray->x(), ray->y(), 1).normalized().cast<float>()
                               : Eigen::Vector3f(0, 0, -1));
    }
  }
}

const Eigen::Vector3f& BoardRenderer::Ray(int column, int row) const {
  return rays_[static_cast<size_t>(row * columns_ + column)];
}

cv::Rect BoardRenderer::PartWith(const Board& board, const RigidTransform& cam_from_board) const {
  constexpr int kSteps = 40;  // along each side of the board
  const cv::Rect all(0, 0, static_cast<int>(image_.width), static_cast<int>(image_.height));
  Eigen::Vector2d low_m(0, 0), high_m(0, 0);
  for (const Eigen::Vector3d& point : board.OneSide().Points()) {
    low_m = low_m.cwiseMin(point.head<2>());
    high_m = high_m.cwiseMax(point.head<2>());
  }
  // Squares and margin beside the outermost points.
  low_m.array() -= 2.5 * board.spacing_m;
  high_m.array() += 2.5 * board.spacing_m;
  Eigen::Vector2d low_px(all.width, all.height), high_px(0, 0);
  for (int row = 0; row <= kSteps; ++row) {
    for (int column = 0; column <= kSteps; ++column) {
      const Eigen::Array2d share(static_cast<double>(column) / kSteps,
                                 static_cast<double>(row) / kSteps);
      const Eigen::Vector2d at = low_m.array() + share * (high_m - low_m).array();
      Eigen::Vector2d pixel;
      const Eigen::Vector3d in_cam = cam_from_board * Eigen::Vector3d(at.x(), at.y(), 0);
      if (!(in_cam.z() > 0) || !Project(lens_, in_cam, &pixel)) return all;
      low_px = low_px.cwiseMin(pixel);
      high_px = high_px.cwiseMax(pixel);
    }
  }
  const cv::Point corner(static_cast<int>(std::floor(low_px.x())) - 2,
                         static_cast<int>(std::floor(low_px.y())) - 2);
  return all & cv::Rect(corner, cv::Point(static_cast<int>(high_px.x()) + 4,
                                          static_cast<int>(high_px.y()) + 4));
}

cv::Mat BoardRenderer::Render(const Board& board, const RigidTransform& cam_from_board,
                              double blur_px, double noise_grey, uint64_t seed) const {
  const BoardSide side = board.SideSeenFrom(cam_from_board.SourceFromTargetTranslation());
  const RigidTransform cam_from_side =
      side == BoardSide::kBack ? cam_from_board * board.FrontFromBack() : cam_from_board;
  const RigidTransform board_from_cam = cam_from_side.Inverse();
  const Eigen::Matrix3f turn = board_from_cam.rotation.toRotationMatrix().cast<float>();
  const Eigen::Vector3f eye = board_from_cam.translation_m.cast<float>();
  std::optional<MarkerPattern> markers;
  if (board.HasMarkers()) markers.emplace(board, side);
  // z points away from who looks at the front, of an April grid towards him.
  const float away = board.kind == BoardKind::kAprilGrid ? -1 : 1;
  cv::Mat1f light(static_cast<int>(image_.height), static_cast<int>(image_.width), kGround);
  const cv::Rect part = PartWith(board, cam_from_side);
  for (int y = part.y; y < part.y + part.height; ++y) {
    for (int x = part.x; x < part.x + part.width; ++x) {
      float sum = 0;
      for (int sample = 0; sample < kSubpixels * kSubpixels; ++sample) {
        // No two samples share a column or a row, so that also an upright edge moves in steps of a
        // sixteenth of a pixel.
        const auto offset = [](int coarse, int fine) {
          const float step = (static_cast<float>(fine) + 0.5f) / kSubpixels;
          return (static_cast<float>(coarse) + step) / kSubpixels - 0.5f;
        };
        const int i = sample % kSubpixels, j = sample / kSubpixels;
        const float u = (static_cast<float>(x) + offset(i, j) + 1) / kRayStep;
        const float v = (static_cast<float>(y) + offset(j, i) + 1) / kRayStep;
        const int column = static_cast<int>(u), row = static_cast<int>(v);
        const float a = u - static_cast<float>(column), b = v - static_cast<float>(row);
        const Eigen::Vector3f ray =
            turn * ((1 - b) * ((1 - a) * Ray(column, row) + a * Ray(column + 1, row)) +
                    b * ((1 - a) * Ray(column, row + 1) + a * Ray(column + 1, row + 1)));
        const float distance = away * ray.z() > 0 ? -eye.z() / ray.z() : -1;
        if (!(distance > 0)) {
          sum += kGround;
          continue;
        }
        const Eigen::Vector3f at = eye + distance * ray;
        sum += markers ? markers->ColourAt(at) : ColourOf(board, at);
      }
      light(y, x) = sum / (kSubpixels * kSubpixels);
    }
  }
  if (blur_px > 0) cv::GaussianBlur(light, light, cv::Size(0, 0), blur_px);
  cv::Mat1f grain(light.size());
  cv::RNG random(seed);
  random.fill(grain, cv::RNG::NORMAL, 0, noise_grey);
  cv::Mat image;
  cv::Mat1f(light + grain).convertTo(image, CV_8U);
  return image;
}

}  // namespace rigcal
