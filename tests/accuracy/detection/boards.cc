// SPDX-License-Identifier: Apache-2.0
// Printed boards. First their points in rendered pictures: found, errors against the projections of
// the points (of circles, of the centroids of their images), and the stated sigmas, by tilt. Then
// lenses from what a camera shows of a board, without pictures: how far the result is from the true
// lens over the image, and whether its stated sigmas hold. Then rigs from a waved board.
#include <fmt/core.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "agent/detect/board/board_detector.h"
#include "common/camera/camera_model.h"
#include "common/camera/intrinsics_vector.h"
#include "common/lens/circle_image.h"
#include "common/lens/lens_solver.h"
#include "common/statistics/robust_statistics.h"
#include "tests/accuracy/detection/board_guidance.h"
#include "tests/accuracy/detection/board_rates.h"
#include "tests/accuracy/detection/detection_experiments.h"
#include "tests/accuracy/detection/event_boards.h"
#include "tests/accuracy/seed_options.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/solver/line_delays_experiment.h"
#include "tests/agent/detect/board/rendered_board.h"
#include "tests/common/lens/known_lens.h"

namespace rigcal::accuracy {
namespace {

constexpr const char* kBoards[] = {
    "board:checker,9x6,0.03", "board:charuco,9x6,0.035,0.025,5x5_100",
    "board:aprilgrid,6x4,0.04,0.3", "board:circles,4x11,0.02", "board:circles-symmetric,9x6,0.03"};
constexpr double kTiltsDeg[] = {0, 30, 45, 60};
constexpr double kRigSeconds = 20;

struct BoardCase {
  std::string name;
  double blur_px = 0, noise_grey = 0;
  bool is_fisheye = false;
};
const BoardCase kCases[] = {{"clean", 0.5, 0, false},
                            {"blur 0.7 px, noise 2 grey", 0.7, 2, false},
                            {"fisheye, blur 0.7 px, noise 2 grey", 0.7, 2, true}};

struct BoardResult {
  int shown = 0, found = 0;         // pictures
  int points = 0, seen = 0;         // of pictures in which the board was found
  std::vector<double> squares_px2;  // of each coordinate's error
  Eigen::Vector2d sum_px = Eigen::Vector2d::Zero();
  double nees = 0;  // sum over both coordinates of points with a sigma
  int with_sigma = 0;
};

// A picture of a board that is all in the image, turned any way.
BoardResult Look(const Board& board, const BoardCase& how, double tilt_deg, int seed) {
  using testing::kKnownImage;
  std::mt19937 random(static_cast<uint32_t>(seed));
  std::uniform_real_distribution<double> unit(0, 1);
  const Intrinsics lens = how.is_fisheye ? testing::KnownFisheye() : testing::KnownPinhole();
  const testing::BoardRenderer renderer(lens, kKnownImage);
  const std::vector<Eigen::Vector3d> points = board.Points();
  RigidTransform pose;
  std::vector<Eigen::Vector2d> pixels;
  for (bool is_inside = false; !is_inside;) {
    const double towards = 2 * std::numbers::pi * unit(random);
    const double tilt = tilt_deg * std::numbers::pi / 180;
    const double near_m = how.is_fisheye ? 0.25 : 0.5;
    const Eigen::Vector2d at(640 * (0.3 + 0.4 * unit(random)), 480 * (0.3 + 0.4 * unit(random)));
    pose = testing::BoardAt(
        board, lens, at, near_m * (1 + 0.6 * unit(random)),
        {tilt * std::cos(towards), tilt * std::sin(towards), 2 * std::numbers::pi * unit(random)});
    if (board.kind == BoardKind::kAprilGrid) {  // its y points up
      Eigen::Vector3d middle = Eigen::Vector3d::Zero();
      for (const auto& point : points) middle += point / board.point_count();
      const Eigen::Vector3d there = pose * middle;
      pose.rotation = pose.rotation * Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX());
      pose.translation_m = there - pose.rotation * middle;
    }
    pixels.clear();
    is_inside = true;
    for (const Eigen::Vector3d& point : points) {
      Eigen::Vector2d pixel, offset_px;
      is_inside = is_inside && Project(lens, pose * point, &pixel) && pixel.x() > 25 &&
                  pixel.y() > 25 && pixel.x() < 614 && pixel.y() < 454;
      if (is_inside && board.HasCircles()) {
        is_inside = CircleOffset(lens, pose, point, 0.5 * board.CircleDiameter(), &offset_px);
        pixel += offset_px;
      }
      pixels.push_back(pixel);
    }
  }
  BoardResult result;
  result.shown = 1;
  const cv::Mat image = renderer.Render(board, pose, how.blur_px, how.noise_grey);
  const auto seen = agent::FindBoard(board, testing::MonoView(image));
  if (!seen.ok() || !seen->has_value()) return result;
  const bool is_twin = board.HasTwin() && ((*seen)->pixels[0] - pixels[0]).norm() > 5;
  if (is_twin) std::reverse(pixels.begin(), pixels.end());
  result.found = 1;
  result.points = board.point_count();
  for (size_t i = 0; i < pixels.size(); ++i) {
    if (!(*seen)->Sees(i)) continue;
    ++result.seen;
    const Eigen::Vector2d error = (*seen)->pixels[i] - pixels[i];
    result.squares_px2.push_back(error.x() * error.x());
    result.squares_px2.push_back(error.y() * error.y());
    result.sum_px += error;
    if ((*seen)->sigmas_px.empty()) continue;
    result.nees += error.squaredNorm() / std::pow((*seen)->sigmas_px[i], 2);
    result.with_sigma += 2;
  }
  return result;
}

void PrintPoints(const SeedOptions& seeds) {
  fmt::print(
      "points of boards in rendered pictures of 640x480\n"
      "{:36} {:42} {:>4}  {:>7} {:>8}  {:>6} {:>6} {:>6}  {:>5}\n",
      "picture", "board", "tilt", "found %", "points %", "rms px", "p95 px", "bias", "NEES");
  for (const BoardCase& how : kCases) {
    for (const char* text : kBoards) {
      for (const double tilt : kTiltsDeg) {
        const Board board = *ParseBoard(text);
        const auto all = RunAll<BoardResult>(seeds.count, seeds.threads, [&](int i) {
          return Look(board, how, tilt, seeds.first + i);
        });
        BoardResult sum;
        for (const BoardResult& one : all) {
          sum.shown += one.shown;
          sum.found += one.found;
          sum.points += one.points;
          sum.seen += one.seen;
          sum.squares_px2.insert(sum.squares_px2.end(), one.squares_px2.begin(),
                                 one.squares_px2.end());
          sum.sum_px += one.sum_px;
          sum.nees += one.nees;
          sum.with_sigma += one.with_sigma;
        }
        double squares = 0;
        for (const double square : sum.squares_px2) squares += square;
        const auto count = static_cast<double>(std::max<size_t>(1, sum.squares_px2.size()));
        const double p95 =
            sum.squares_px2.empty() ? 0 : std::sqrt(InterpolatedQuantile(sum.squares_px2, 0.95));
        fmt::print("{:36} {:42} {:4.0f}  {:7.1f} {:8.1f}  {:6.3f} {:6.3f} {:6.3f}  {:5.2f}\n",
                   how.name, text, tilt, 100.0 * sum.found / sum.shown,
                   100.0 * sum.seen / std::max(1, sum.points), std::sqrt(squares / count), p95,
                   sum.sum_px.norm() / std::max(1, sum.seen),
                   sum.with_sigma > 0 ? sum.nees / sum.with_sigma : 0.0);
      }
    }
  }
}

struct LensResult {
  bool is_ok = false;
  bool is_right_model = false;
  double p95_px = 0;
  std::vector<double> squares;  // of the errors of the intrinsics over their sigmas
};

LensResult SolveOne(LensModel model, bool choose, int seed) {
  const Board board = *ParseBoard("board:checker,9x6,0.03");
  Intrinsics lens =
      model == LensModel::kFisheye ? testing::KnownFisheye() : testing::KnownPinhole();
  if (model == LensModel::kPinhole8) {
    lens.model = DistortionModel::kRational;
    lens.distortion = {0.35, 0.08, 0.0007, -0.0005, 0.01, 0.62, 0.12, 0.03};
  }
  const bool is_wide = model == LensModel::kFisheye;
  const auto poses =
      testing::WavedBoard(board, lens, testing::kKnownImage, 40, is_wide ? 0.2 : 0.4,
                          is_wide ? 0.4 : 0.8, 0.9, static_cast<uint32_t>(seed), 0.8);
  const auto views = testing::SeenBoards(board, lens, testing::kKnownImage, poses, 0.1,
                                         static_cast<uint32_t>(seed));
  LensOptions options;
  if (!choose) options.model = model;
  LensResult result;
  const auto solution = SolveLens(views, testing::kKnownImage, options);
  if (!solution.ok()) return result;
  result.is_right_model = solution->model == model;
  const auto difference = CompareLenses(lens, solution->intrinsics, testing::kKnownImage);
  if (!difference.ok()) return result;
  result.is_ok = true;
  result.p95_px = difference->p95_px;
  if (!result.is_right_model) return result;
  std::vector<double> truth = {lens.fx_px, lens.fy_px, lens.cx_px, lens.cy_px};
  std::vector<double> found = {solution->intrinsics.fx_px, solution->intrinsics.fy_px,
                               solution->intrinsics.cx_px, solution->intrinsics.cy_px};
  truth.insert(truth.end(), lens.distortion.begin(), lens.distortion.end());
  found.insert(found.end(), solution->intrinsics.distortion.begin(),
               solution->intrinsics.distortion.end());
  for (Eigen::Index i = 0; i < solution->sigmas.size(); ++i) {
    const auto k = static_cast<size_t>(i);
    result.squares.push_back(std::pow((found[k] - truth[k]) / solution->sigmas[i], 2));
  }
  return result;
}

void PrintLenses(const SeedOptions& seeds) {
  fmt::print(
      "\nlenses from 40 views of board:checker,9x6,0.03 with 0.1 px of noise in each coordinate; a "
      "lens\nwhose sigmas are right has squared errors over variances of 1 in the mean\n"
      "{:10} {:>6} {:>12}  {:>28}  {:>14}\n",
      "model", "solved", "chosen, %", "95 % of the image within, px", "error/variance");
  for (const LensModel model : {LensModel::kPinhole5, LensModel::kPinhole8, LensModel::kFisheye}) {
    const auto chosen = RunAll<LensResult>(
        seeds.count, seeds.threads, [&](int i) { return SolveOne(model, true, seeds.first + i); });
    const auto told = RunAll<LensResult>(
        seeds.count, seeds.threads, [&](int i) { return SolveOne(model, false, seeds.first + i); });
    int right = 0, solved = 0;
    for (const LensResult& result : chosen) right += result.is_right_model ? 1 : 0;
    std::vector<double> distances_px, squares;
    for (const LensResult& result : told) {
      if (!result.is_ok) continue;
      ++solved;
      distances_px.push_back(result.p95_px);
      squares.insert(squares.end(), result.squares.begin(), result.squares.end());
    }
    double mean = 0;
    for (const double square : squares) mean += square / static_cast<double>(squares.size());
    fmt::print(
        "{:10} {:6} {:12.0f}  {:>13.3f} {:>6.3f} (worst)  {:14.2f}\n", LensModelName(model), solved,
        100.0 * right / seeds.count,
        distances_px.empty() ? 0 : InterpolatedQuantile(distances_px, 0.5),
        distances_px.empty() ? 0 : *std::max_element(distances_px.begin(), distances_px.end()),
        mean);
  }
}

// A board that is waved before cameras that nothing synchronises, with rolling shutters. Their
// points are simulated; of a plane both sides are seen.
void PrintRig(const SeedOptions& seeds) {
  fmt::print(
      "\nboard:checker,9x6,0.04 waved for {} s before 4 cameras of 25 Hz, 0.3 px: free-running, "
      "rolling shutters of 5 to\n50 us a row, clocks up to so many seconds apart; errors over the "
      "Cramer-Rao bound\n{:>8} {:>7} {:>8} {:>5} {:>10} {:>9} {:>9} {:>16} {:>17} {:>6}\n",
      kRigSeconds, "clocks", "solved", "rejected", "good", "positions", "offsets", "shutters",
      "offset RMS, ms", "worst offset, ms", "CPU s");
  for (const double apart_s : {0.0, 1.0, 5.0}) {
    LineDelaysOptions options;
    options.target = *MakeBoardTarget(*ParseBoard("board:checker,9x6,0.04"), 0);
    options.camera_count = 4;
    options.duration_s = kRigSeconds;
    options.rate_hz = 25;
    options.largest_offset_s = 0.5 * apart_s;
    const auto trials = RunAll<LineDelaysTrial>(seeds.count, seeds.threads, [&](int i) {
      return RunLineDelaysTrial(options, static_cast<uint32_t>(seeds.first + i));
    });
    double worst_s = 0, squares_s2 = 0, cpu_s = 0;
    int offsets = 0;
    for (size_t i = 0; i < trials.size(); ++i) {
      const LineDelaysTrial& trial = trials[i];
      if (!trial.status.ok()) {
        fmt::print("  seed {}: {}\n", seeds.first + static_cast<int>(i), trial.status.ToString());
        continue;
      }
      worst_s = std::max(worst_s, trial.worst_offset_s);
      squares_s2 += trial.offset_error_s2;
      offsets += trial.camera_count - 1;
      cpu_s += trial.cpu_s / static_cast<double>(trials.size());
    }
    const LineDelaysSummary summary = Summarise(trials);
    fmt::print("{:6.1f} s {:7} {:8} {:5} {:10.2f} {:9.2f} {:9.2f} {:16.4f} {:17.4f} {:6.1f}\n",
               apart_s, static_cast<int>(trials.size()) - summary.failed, summary.failed,
               summary.good, summary.rmse_by_bound, summary.offset_by_bound, summary.delay_by_bound,
               1e3 * std::sqrt(squares_s2 / std::max(1, offsets)), 1e3 * worst_s, cpu_s);
  }
}

// The part that --only names, or all of them.
int RunBoards(const SeedOptions& seeds) {
  const auto is_wanted = [&](const char* part) { return seeds.only.empty() || seeds.only == part; };
  if (is_wanted("points")) PrintPoints(seeds);
  if (is_wanted("rates")) PrintBoardRates(seeds);
  if (is_wanted("lenses")) PrintLenses(seeds);
  if (is_wanted("guidance")) PrintBoardGuidance(seeds);
  if (is_wanted("rig")) PrintRig(seeds);
  // Minutes for each case, so only where it is asked for: "events", "events OLED".
  if (seeds.only.starts_with("events")) {
    const std::string rest = seeds.only.substr(6);
    PrintEventBoards(seeds, rest.empty() ? rest : rest.substr(1));
  }
  return 0;
}

}  // namespace

Experiment Boards() {
  SeedOptions defaults;
  defaults.count = 20;
  return SeedExperiment("boards",
                        "points of printed boards, lenses from them, views that they need, rigs",
                        defaults, RunBoards);
}

}  // namespace rigcal::accuracy
