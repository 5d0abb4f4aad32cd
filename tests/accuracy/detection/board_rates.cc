// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/board_rates.h"

#include <fmt/core.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <random>
#include <vector>

#include "agent/detect/board/board_detector.h"
#include "common/board/marker_cells.h"
#include "common/board/marker_dictionary.h"
#include "common/camera/camera_model.h"
#include "common/lens/circle_image.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/agent/detect/board/rendered_board.h"
#include "tests/common/lens/known_lens.h"

namespace rigcal::accuracy {
namespace {

constexpr const char* kRatedBoards[] = {
    "board:checker,9x6,0.03", "board:charuco,9x6,0.035,0.025,5x5_100",
    "board:aprilgrid,6x4,0.04,0.3", "board:circles,4x11,0.02", "board:circles-symmetric,9x6,0.03"};
constexpr double kCutShare = 0.25;  // of the views, cut by the border
constexpr double kWrongPx = 1;      // from the truth: another point was found
constexpr size_t kLeastTags = 4;    // kalibr's rule
constexpr size_t kLeastPoints = 6;  // of a ChArUco board, as rigcal wants

struct RatedView {
  cv::Mat image;
  std::vector<Eigen::Vector2d> pixels;  // of the points, also where they are outside
};

RatedView DrawView(const Board& board, uint32_t seed) {
  using testing::kKnownImage;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  const bool is_fisheye = unit(random) < 0.5;
  const bool is_cut = unit(random) < kCutShare;
  const Intrinsics lens = is_fisheye ? testing::KnownFisheye() : testing::KnownPinhole();
  const double blur_px = 0.3 + 1.2 * unit(random), noise_grey = 6 * unit(random);
  RatedView view;
  for (;;) {
    const double tilt = 70 * unit(random) * std::numbers::pi / 180;
    const double towards = 2 * std::numbers::pi * unit(random);
    const Eigen::Vector2d at(640 * unit(random), 480 * unit(random));
    RigidTransform pose = testing::BoardAt(
        board, lens, at, (is_fisheye ? 0.25 : 0.5) * (1 + unit(random)),
        {tilt * std::cos(towards), tilt * std::sin(towards), 2 * std::numbers::pi * unit(random)});
    if (board.kind == BoardKind::kAprilGrid) {  // its y points up
      Eigen::Vector3d middle = Eigen::Vector3d::Zero();
      for (const auto& point : board.Points()) middle += point / board.point_count();
      const Eigen::Vector3d there = pose * middle;
      pose.rotation = pose.rotation * Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX());
      pose.translation_m = there - pose.rotation * middle;
    }
    view.pixels.clear();
    int inside = 0;
    for (const Eigen::Vector3d& point : board.Points()) {
      Eigen::Vector2d pixel(-1e4, -1e4), offset_px;
      if (Project(lens, pose * point, &pixel) && board.HasCircles() &&
          CircleOffset(lens, pose, point, 0.5 * board.CircleDiameter(), &offset_px)) {
        pixel += offset_px;
      }
      const bool is_inside = pixel.x() > 12 && pixel.y() > 12 && pixel.x() < 627 && pixel.y() < 467;
      inside += is_inside ? 1 : 0;
      view.pixels.push_back(pixel);
    }
    const int count = board.point_count();
    if (is_cut ? inside < count && 2 * inside >= count : inside == count) {
      view.image =
          testing::BoardRenderer(lens, kKnownImage).Render(board, pose, blur_px, noise_grey);
      return view;
    }
  }
}

// Made by a function until OpenCV 4.6, by a constructor from 4.7 on.
template <typename CharucoBoard>
cv::Ptr<CharucoBoard> BoardOfOpenCv(const Board& board) {
  const auto square = static_cast<float>(board.spacing_m),
             marker = static_cast<float>(board.marker_m);
  const auto dictionary = MarkerDictionary(DictionaryOf(board));
  const int across = board.columns + 1, high = board.rows + 1;
  if constexpr (requires { CharucoBoard::create(across, high, square, marker, dictionary); }) {
    return CharucoBoard::create(across, high, square, marker, dictionary);
  } else {
    return cv::makePtr<CharucoBoard>(cv::Size(across, high), square, marker, *dictionary);
  }
}

// As its documentation uses OpenCV.
bool OpenCvFinds(const Board& board, const cv::Mat& image) {
  const cv::Size size(board.columns, board.rows);
  std::vector<cv::Point2f> points;
  switch (board.kind) {
    case BoardKind::kChecker:
      return cv::findChessboardCornersSB(image, size, points);
    case BoardKind::kCircles:
      return cv::findCirclesGrid(image, size, points, cv::CALIB_CB_ASYMMETRIC_GRID);
    case BoardKind::kCirclesSymmetric:
      return cv::findCirclesGrid(image, size, points, cv::CALIB_CB_SYMMETRIC_GRID);
    case BoardKind::kCharuco:
    case BoardKind::kAprilGrid:
      break;
  }
  const auto parameters = cv::makePtr<cv::aruco::DetectorParameters>();
  if (board.kind == BoardKind::kAprilGrid) parameters->markerBorderBits = 2;
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  cv::aruco::detectMarkers(image, MarkerDictionary(DictionaryOf(board)), corners, ids, parameters);
  if (board.kind == BoardKind::kAprilGrid) return ids.size() >= kLeastTags;
  if (ids.empty()) return false;
  const auto charuco = BoardOfOpenCv<cv::aruco::CharucoBoard>(board);
  std::vector<int> point_ids;
  cv::aruco::interpolateCornersCharuco(corners, ids, image, charuco, points, point_ids);
  return point_ids.size() >= kLeastPoints;
}

struct RateResult {
  int shown = 0, ours = 0, wrong = 0, by_opencv = 0;
};

RateResult Rate(const Board& board, uint32_t seed) {
  const RatedView view = DrawView(board, seed);
  RateResult result;
  result.shown = 1;
  result.by_opencv = OpenCvFinds(board, view.image) ? 1 : 0;
  const auto seen = agent::FindBoard(board, testing::MonoView(view.image));
  if (!seen.ok() || !seen->has_value()) return result;
  const std::vector<Eigen::Vector2d>& found = (*seen)->pixels;
  // A board with a twin may be counted from its other end.
  const size_t count = view.pixels.size();
  for (const bool turned : {false, true}) {
    bool fits = true;
    for (size_t i = 0; i < count; ++i) {
      const Eigen::Vector2d& truth = view.pixels[turned ? count - 1 - i : i];
      fits = fits && (!(*seen)->Sees(i) || (found[i] - truth).norm() < kWrongPx);
    }
    if (fits && (!turned || board.HasTwin())) result.ours = 1;
  }
  result.wrong = 1 - result.ours;
  return result;
}

}  // namespace

void PrintBoardRates(const SeedOptions& seeds) {
  fmt::print(
      "\nviews of boards that are found, {} of each in 640x480: tilted by 0 to 70 degrees, blur "
      "0.3 "
      "to 1.5 px, noise\nup to 6 grey levels, a quarter cut by the border, half by a fisheye; "
      "wrong: "
      "a point is {} px off\n{:42} {:>7} {:>7} {:>9}\n",
      seeds.count, kWrongPx, "board", "found %", "wrong %", "OpenCV %");
  for (const char* text : kRatedBoards) {
    const Board board = *ParseBoard(text);
    const auto all = RunAll<RateResult>(seeds.count, seeds.threads, [&](int i) {
      return Rate(board, static_cast<uint32_t>(seeds.first + i));
    });
    RateResult sum;
    for (const RateResult& one : all) {
      sum.shown += one.shown;
      sum.ours += one.ours;
      sum.wrong += one.wrong;
      sum.by_opencv += one.by_opencv;
    }
    const auto percent = [&](int part) { return 100.0 * part / sum.shown; };
    fmt::print("{:42} {:7.1f} {:7.1f} {:9.1f}\n", text, percent(sum.ours), percent(sum.wrong),
               percent(sum.by_opencv));
  }
}

}  // namespace rigcal::accuracy
