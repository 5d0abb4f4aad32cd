// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/board/pattern_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace rigcal::agent {
namespace {

constexpr int kMostStepsOfDrawing = 8;
constexpr double kSmallMovePx = 3e-3, kRoughMovePx = 0.05;
constexpr double kDrawingErrorPx = 0.011;     // how far patterns without noise are off
constexpr double kPlacesPerPixel = 3;         // of a drawing
constexpr int kLeastBorderPx = 4;             // from the middle of a window to the border
constexpr double kPatchRimPx = 3;             // how far a drawing reaches beyond the window
constexpr double kLeastPatternContrast = 10;  // grey levels from black to white
// One sigma of the window's Gaussian weights, of its half width.
constexpr double kPatternWeightShare = 0.6;
constexpr double kLeastPatternBlurPx = 0.3, kMostPatternBlurPx = 4;

// Move x, y; stretch xx, xy, yx, yy; perspective x, y; blur; gain; offset.
constexpr int kUnknowns = 11;
using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;
using Information = Eigen::Matrix<double, kUnknowns, kUnknowns>;

// A drawing and its derivatives, read between places.
class Drawing {
 public:
  // White; its slopes along x and y, per pixel; its Laplacian, per square pixel.
  using Place = Eigen::Vector4f;

  explicit Drawing(const PatternPatch& patch)
      : per_pixel_(patch.per_pixel), side_(patch.white.cols - 2), centre_px_(patch.centre_px) {
    if (side_ < 2) return;
    const auto per = static_cast<float>(patch.per_pixel);
    places_.reserve(static_cast<size_t>(side_ * side_));
    for (int y = 1; y <= side_; ++y) {
      const float* const above = patch.white.ptr<float>(y - 1);
      const float* const here = patch.white.ptr<float>(y);
      const float* const below = patch.white.ptr<float>(y + 1);
      for (int x = 1; x <= side_; ++x) {
        places_.emplace_back(
            here[x], 0.5f * per * (here[x + 1] - here[x - 1]), 0.5f * per * (below[x] - above[x]),
            per * per * (above[x] + below[x] + here[x - 1] + here[x + 1] - 4 * here[x]));
      }
    }
  }

  // False: outside.
  bool At(const Eigen::Vector2d& offset_px, Place* place) const {
    const double middle = 0.5 * (side_ - 1);
    const double x = per_pixel_ * offset_px.x() + middle, y = per_pixel_ * offset_px.y() + middle;
    if (!(x >= 0 && y >= 0 && x < side_ - 1 && y < side_ - 1)) return false;
    const int i = static_cast<int>(x), j = static_cast<int>(y);
    const auto a = static_cast<float>(x - i), b = static_cast<float>(y - j);
    const Place* const upper = &places_[static_cast<size_t>(j * side_ + i)];
    const Place* const lower = upper + side_;
    *place =
        (1 - b) * ((1 - a) * upper[0] + a * upper[1]) + b * ((1 - a) * lower[0] + a * lower[1]);
    return true;
  }

  const Eigen::Vector2d& centre_px() const { return centre_px_; }
  // By whole pixels, by which the drawing is the same.
  void Move(const Eigen::Vector2d& pixels) { centre_px_ += pixels; }

 private:
  double per_pixel_ = 0;
  int side_ = 0;
  Eigen::Vector2d centre_px_;
  std::vector<Place> places_;
};

// Its part that is in the image.
struct Window {
  cv::Point middle;
  int half = 0;

  int Left() const { return std::max(0, middle.x - half); }
  int Top() const { return std::max(0, middle.y - half); }
  int Right(const cv::Mat& grey) const { return std::min(grey.cols - 1, middle.x + half); }
  int Bottom(const cv::Mat& grey) const { return std::min(grey.rows - 1, middle.y + half); }
  bool IsIn(const cv::Mat& grey) const {
    return middle.x >= kLeastBorderPx && middle.y >= kLeastBorderPx &&
           middle.x + kLeastBorderPx < grey.cols && middle.y + kLeastBorderPx < grey.rows;
  }
};

struct PatternSums {
  Information information = Information::Zero(), scatter = Information::Zero();
  Unknowns gradient = Unknowns::Zero();
  double cost = 0, weights = 0;
  double mean = 0, square = 0;  // weighted sums of grey and of its square

  double Spread() const { return square - mean * mean / std::max(weights, 1e-9); }
};

// Where the model looks for what an image shows at `offset_px`.
Eigen::Vector2d Looked(const Eigen::Vector2d& offset_px, const Unknowns& p) {
  const Eigen::Vector2d moved(p[2] * offset_px.x() + p[3] * offset_px.y(),
                              p[4] * offset_px.x() + p[5] * offset_px.y());
  return offset_px - p.head<2>() - moved -
         (p[6] * offset_px.x() + p[7] * offset_px.y()) * offset_px;
}

// A Gaussian around the middle: w(x, y) = across(x) down(y).
class Weights {
 public:
  Weights(const Window& window, const Eigen::Vector2d& centre_px) : window_(window) {
    const double falloff = 0.5 / std::pow(kPatternWeightShare * window.half, 2);
    for (int i = -window.half; i <= window.half; ++i) {
      across_.push_back(std::exp(-falloff * std::pow(window.middle.x + i - centre_px.x(), 2)));
      down_.push_back(std::exp(-falloff * std::pow(window.middle.y + i - centre_px.y(), 2)));
    }
  }
  double At(int x, int y) const {
    return across_[static_cast<size_t>(x - window_.middle.x + window_.half)] *
           down_[static_cast<size_t>(y - window_.middle.y + window_.half)];
  }

 private:
  Window window_;
  std::vector<double> across_, down_;
};

PatternSums SumsOver(const cv::Mat& grey, const Window& window, const Drawing& drawing,
                     const Unknowns& p, bool with_scatter = false) {
  PatternSums sums;
  const Weights weights(window, drawing.centre_px());
  for (int y = window.Top(); y <= window.Bottom(grey); ++y) {
    const uint8_t* const row = grey.ptr<uint8_t>(y);
    for (int x = window.Left(); x <= window.Right(grey); ++x) {
      const Eigen::Vector2d offset = Eigen::Vector2d(x, y) - drawing.centre_px();
      Drawing::Place place;
      if (!drawing.At(Looked(offset, p), &place)) continue;
      const double u = offset.x(), v = offset.y(), gain = p[9];
      const double by_x = -gain * place[1], by_y = -gain * place[2];
      const double along = by_x * u + by_y * v;
      const double model = place[0] + p[8] * place[3];
      Unknowns slope;
      slope << by_x, by_y, by_x * u, by_x * v, by_y * u, by_y * v, along * u, along * v,
          gain * place[3], model, 1;
      const double residual = row[x] - gain * model - p[10];
      const double weight = weights.At(x, y);
      const Unknowns weighted = weight * slope;
      sums.information.noalias() += weighted * slope.transpose();
      if (with_scatter) sums.scatter.noalias() += weighted * weighted.transpose();
      sums.gradient += residual * weighted;
      sums.cost += weight * residual * residual;
      sums.weights += weight;
      sums.mean += weight * row[x];
      sums.square += weight * row[x] * row[x];
    }
  }
  return sums;
}

// Gain and offset of the drawing as it is.
void FitContrast(const cv::Mat& grey, const Window& window, const Drawing& drawing, Unknowns* p) {
  const Weights weights(window, drawing.centre_px());
  double w = 0, a = 0, b = 0, ab = 0, bb = 0;
  for (int y = window.Top(); y <= window.Bottom(grey); ++y) {
    const uint8_t* const row = grey.ptr<uint8_t>(y);
    for (int x = window.Left(); x <= window.Right(grey); ++x) {
      Drawing::Place place;
      if (!drawing.At(Eigen::Vector2d(x, y) - drawing.centre_px(), &place)) continue;
      const double weight = weights.At(x, y), white = place[0];
      w += weight;
      a += weight * row[x];
      b += weight * white;
      ab += weight * white * row[x];
      bb += weight * white * white;
    }
  }
  if (!(w > 0)) return;
  const double gain = (ab - a * b / w) / std::max(1e-9, bb - b * b / w);
  (*p)[9] = gain;
  (*p)[10] = (a - gain * b) / w;
}

// The whole pixel at which what is drawn fits best.
Eigen::Vector2d BestMove(const cv::Mat& grey, const Window& window, const Drawing& drawing,
                         int reach) {
  struct Expected {
    int x, y;
    double weight, white;
  };
  std::vector<Expected> expected;
  const Weights weights(window, drawing.centre_px());
  for (int y = window.Top(); y <= window.Bottom(grey); ++y) {
    for (int x = window.Left(); x <= window.Right(grey); ++x) {
      Drawing::Place place;
      if (!drawing.At(Eigen::Vector2d(x, y) - drawing.centre_px(), &place)) continue;
      expected.push_back({x, y, weights.At(x, y), place[0]});
    }
  }
  Eigen::Vector2d best = Eigen::Vector2d::Zero();
  double best_correlation = -1;
  for (int dy = -reach; dy <= reach; ++dy) {
    for (int dx = -reach; dx <= reach; ++dx) {
      double w = 0, a = 0, b = 0, aa = 0, ab = 0, bb = 0;
      for (const Expected& one : expected) {
        const int x = one.x + dx, y = one.y + dy;
        if (x < 0 || y < 0 || x >= grey.cols || y >= grey.rows) continue;
        const double shown = grey.at<uint8_t>(y, x);
        w += one.weight;
        a += one.weight * shown;
        b += one.weight * one.white;
        aa += one.weight * shown * shown;
        ab += one.weight * shown * one.white;
        bb += one.weight * one.white * one.white;
      }
      if (!(w > 0)) continue;
      const double correlation =
          (ab - a * b / w) / std::sqrt(std::max(1e-9, (aa - a * a / w) * (bb - b * b / w)));
      if (correlation > best_correlation) {
        best_correlation = correlation;
        best = Eigen::Vector2d(dx, dy);
      }
    }
  }
  return best;
}

Unknowns PriorOf(const PatternFitOptions& options, double blur_px) {
  // The unknown of the blur is half the change of its square.
  const double blur = std::max(1e-6, options.blur_share * blur_px * blur_px);
  Unknowns prior = Unknowns::Zero();
  prior.head<2>().setConstant(std::pow(options.move_px, -2));
  prior.segment<4>(2).setConstant(std::pow(options.stretch, -2));
  prior.segment<2>(6).setConstant(std::pow(options.perspective, -2));
  prior[8] = std::pow(blur, -2);
  return prior;
}

}  // namespace

double FittedPattern::Sigma() const {
  return std::hypot(kDrawingErrorPx, std::sqrt(0.5 * covariance_px2.trace()));
}

std::optional<FittedPattern> FitPattern(const cv::Mat& grey, const PrintedPattern& pattern,
                                        const LocalPlane& plane, const Eigen::Vector2d& pattern_m,
                                        double blur_px, const PatternFitOptions& options) {
  FittedPattern fitted;
  fitted.plane = plane;
  fitted.blur_px = blur_px;
  for (int drawn = 0; drawn < options.drawings; ++drawn) {
    const Eigen::Vector2d start = fitted.plane.At(pattern_m);
    if (!start.allFinite()) return std::nullopt;
    Window window{
        {static_cast<int>(std::lround(start.x())), static_cast<int>(std::lround(start.y()))},
        options.half_px};
    if (!window.IsIn(grey)) return std::nullopt;
    const double reach_px = options.move_px + options.stretch * window.half + kPatchRimPx;
    Drawing drawing(pattern.Show(fitted.plane, pattern_m, window.half + reach_px, fitted.blur_px,
                                 kPlacesPerPixel));
    if (drawn == 0 && options.search_px > 0) {
      const Eigen::Vector2d move = BestMove(grey, window, drawing, options.search_px);
      fitted.plane = fitted.plane.Moved(move);
      drawing.Move(move);
      window.middle += cv::Point(static_cast<int>(move.x()), static_cast<int>(move.y()));
      if (!window.IsIn(grey)) return std::nullopt;
    }
    Unknowns p = Unknowns::Zero();
    FitContrast(grey, window, drawing, &p);
    PatternSums sums = SumsOver(grey, window, drawing, p);
    const Unknowns prior = PriorOf(options, fitted.blur_px);
    const auto noise_of = [](const PatternSums& of) {
      return std::max(1.0, of.cost / std::max(1e-9, of.weights));
    };
    const auto cost_of = [&](const PatternSums& of, const Unknowns& at, double noise) {
      return of.cost + noise * prior.dot(at.cwiseAbs2());
    };
    double damping = 1e-3;
    const double small_px = options.is_rough ? kRoughMovePx : kSmallMovePx;
    for (int i = 0; i < kMostStepsOfDrawing; ++i) {
      const double noise = noise_of(sums);
      Information damped = sums.information;
      damped.diagonal() *= 1 + damping;
      damped.diagonal() += noise * prior;
      const Unknowns change = damped.ldlt().solve(sums.gradient - noise * prior.cwiseProduct(p));
      const Unknowns next = p + change;
      if (!next.allFinite()) return std::nullopt;
      const PatternSums there = SumsOver(grey, window, drawing, next);
      if (cost_of(there, next, noise) <= cost_of(sums, p, noise) &&
          there.weights > 0.8 * sums.weights) {
        p = next;
        sums = there;
        damping *= 0.1;
        if (change.head<2>().norm() < small_px) break;
      } else {
        damping *= 10;
      }
    }
    // What was looked at elsewhere is a homography of the image (to second order).
    Eigen::Matrix3d there = Eigen::Matrix3d::Identity(), centred = Eigen::Matrix3d::Identity();
    centred.topRightCorner<2, 1>() = drawing.centre_px();
    there.topRightCorner<2, 1>() = p.head<2>();
    there(0, 0) += p[2];
    there(0, 1) += p[3];
    there(1, 0) += p[4];
    there(1, 1) += p[5];
    there(2, 0) = -p[6];
    there(2, 1) = -p[7];
    fitted.plane =
        LocalPlane(centred * there * centred.inverse() * fitted.plane.img_from_pattern());
    fitted.centre_px = drawing.centre_px() + p.head<2>();
    fitted.blur_px =
        std::clamp(std::sqrt(std::max(0.0, fitted.blur_px * fitted.blur_px + 2 * p[8])),
                   kLeastPatternBlurPx, kMostPatternBlurPx);
    fitted.contrast = p[9];
    const double spread = sums.Spread();
    fitted.correlation =
        p[9] > 0 && spread > 0 ? std::sqrt(std::max(0.0, 1 - sums.cost / spread)) : 0;
    if (!(fitted.contrast >= kLeastPatternContrast)) return std::nullopt;
    if (options.is_rough) continue;
    // Weights that are not inverse variances: their least squares has the covariance
    // N^-1 (sum w^2 J J^T) N^-1 times that of a pixel's noise.
    Information information = sums.information;
    information.diagonal() += noise_of(sums) * prior;
    const Information inverse = information.inverse();
    const Information scatter = SumsOver(grey, window, drawing, p, true).scatter;
    const Information spread_of = inverse * scatter * inverse;
    const double used = (inverse * scatter).trace();
    const double noise = sums.cost / std::max(0.2 * sums.weights, sums.weights - used);
    fitted.covariance_px2 = noise * spread_of.topLeftCorner<2, 2>();
    if (!fitted.covariance_px2.allFinite()) return std::nullopt;
  }
  return fitted;
}

}  // namespace rigcal::agent
