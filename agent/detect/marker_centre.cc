// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/marker_centre.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace rigcal::agent {
namespace {

constexpr double kMarginPx = 1.75;  // around the blob, for what its threshold left out
constexpr double kGapPx = 1.0;      // from there to the ring
// Coverage up to which a pixel counts as free, and from which on as covered.
constexpr float kFree = 0.22f, kCovered = 0.8f;
constexpr float kStrange = 0.3f;     // of the contrast: away from all mixtures of the two colours
constexpr double kCore = 0.55;       // of the blob's ellipse: the plateau is read there
constexpr double kMinContrast = 20;  // grey levels
constexpr double kArcPx = 3;         // length of an arc of the ring
constexpr int kMinArcs = 16, kMaxArcs = 64;
constexpr float kAlike = 0.4f;  // of the contrast: as near as this is the marker's colour
// What is this bright further than this outside of the blob is something else.
constexpr double kOwnPx = 1.5;
constexpr float kForeign = 0.4f;
enum Foreign : uint8_t { kBright = 1, kOtherColour = 2 };
constexpr int kMinRingPixels = 24;
constexpr int kMaxIterations = 12;
// Radii of the centroid per skewness, found on rendered pictures.
constexpr double kShiftPerSkewness = 4;
constexpr double kMedianVariance = 1.57;  // of a Gaussian's median against its mean

Eigen::Vector3f Grey(const ImageView& image, int x, int y) {
  const uint8_t* row = image.Row(y);
  if (image.format == PixelFormat::kMono8) return {static_cast<float>(row[x]), 0, 0};
  const uint8_t* pixel = row + 3 * x;
  return {static_cast<float>(pixel[0]), static_cast<float>(pixel[1]), static_cast<float>(pixel[2])};
}

float Median(std::vector<float>* values) {
  const auto middle = values->begin() + static_cast<ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

// One sigma of values around medians of some ten of them, without what does not belong to them.
double NoiseSigma(std::vector<float>* residuals) {
  const float limit = 2.5f * 1.4826f * (Median(residuals) + 0.5f);
  double squares = 0;
  int count = 0;
  for (const float residual : *residuals) {
    if (residual > limit) continue;
    squares += static_cast<double>(residual * residual);
    ++count;
  }
  // The cut leaves 0.95 of a Gaussian's variance; a median of few takes 5 % of it along.
  return std::max(0.5, std::sqrt(squares / (0.9 * std::max(1, count))));
}

}  // namespace

// An ellipse of semi-axes `a` >= `b`, and how far the looked at pixels lie from it.
struct MarkerMeter::Aperture {
  Eigen::Vector2d centre_px;
  Eigen::Matrix2d shape;  // x^T shape x = 1 on the blob's own ellipse
  double a = 1, b = 1;
  double ring_px = 3;

  explicit Aperture(const Blob& blob) : centre_px(blob.centre_px) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(blob.second_moment_px2);
    // A pixel's own extent; a blob of one row has no moment across it.
    const Eigen::Vector2d squared = (4 * eigen.eigenvalues()).cwiseMax(1.0);
    b = std::sqrt(squared[0]);
    a = std::sqrt(squared[1]);
    axes_ = eigen.eigenvectors();
    shape = axes_ * squared.cwiseInverse().asDiagonal() * axes_.transpose();
    ring_px = std::max(3.0, 0.35 * b);
  }

  // Squared radius in units of the ellipse that lies `margin_px` outside of the blob's.
  Eigen::Matrix2d Grown(double margin_px) const {
    const Eigen::Vector2d semi(b + margin_px, a + margin_px);
    return axes_ * semi.cwiseAbs2().cwiseInverse().asDiagonal() * axes_.transpose();
  }
  double Reach() const { return a + kMarginPx + kGapPx + ring_px; }
  // From 1 inside to 0 outside over one pixel about the aperture's edge.
  double Weight(const Eigen::Vector2d& offset, const Eigen::Matrix2d& grown) const {
    const Eigen::Vector2d g = grown * offset;
    const double r2 = offset.dot(g);
    const double slope = g.norm();
    if (!(slope > 1e-9)) return 1;
    return std::clamp(0.5 - 0.5 * (r2 - 1) / slope, 0.0, 1.0);
  }

 private:
  Eigen::Matrix2d axes_;
};

bool MarkerMeter::PlaceWindow(const ImageView& image, const Aperture& aperture,
                              MarkerCentre* centre) {
  const double reach = aperture.Reach();
  const Eigen::Vector2d& at = aperture.centre_px;
  // The ring may be cut, what is summed may not.
  const double need = aperture.a + 1;
  centre->cut = at.x() - need < 0 || at.y() - need < 0 || at.x() + need > image.width - 1 ||
                at.y() + need > image.height - 1;
  window_.x = std::max(static_cast<int>(std::floor(at.x() - reach)), 0);
  window_.y = std::max(static_cast<int>(std::floor(at.y() - reach)), 0);
  window_.width =
      std::min(static_cast<int>(std::ceil(at.x() + reach)) + 1, image.width) - window_.x;
  window_.height =
      std::min(static_cast<int>(std::ceil(at.y() + reach)) + 1, image.height) - window_.y;
  return !window_.empty();
}

bool MarkerMeter::ReadPlateau(const ImageView& image, const Aperture& aperture,
                              MarkerCentre* centre) const {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  int count = 0;
  for (int y = window_.y; y < window_.y + window_.height; ++y) {
    for (int x = window_.x; x < window_.x + window_.width; ++x) {
      const Eigen::Vector2d d(x - aperture.centre_px.x(), y - aperture.centre_px.y());
      if (d.dot(aperture.shape * d) >= kCore * kCore) continue;
      sum += Grey(image, x, y);
      ++count;
    }
  }
  if (count == 0) return false;
  centre->plateau_grey = (sum / static_cast<float>(count)).cast<double>();
  return true;
}

Eigen::Vector3f MarkerMeter::Background(const Eigen::Vector2d& offset, size_t* arc) const {
  const auto count = static_cast<double>(arcs_.size());
  const double turn =
      (std::atan2(offset.y(), offset.x()) / (2 * std::numbers::pi) + 0.5) * count - 0.5;
  const double low = std::floor(turn);
  const auto share = static_cast<float>(turn - low);
  const auto first = static_cast<size_t>(low + count) % arcs_.size();
  const size_t second = (first + 1) % arcs_.size();
  *arc = share < 0.5f ? first : second;
  return (1 - share) * arcs_[first].background + share * arcs_[second].background;
}

bool MarkerMeter::ReadBackground(const ImageView& image, const Aperture& aperture,
                                 MarkerCentre* centre) {
  const Eigen::Matrix2d ring = aperture.Grown(kMarginPx + kGapPx);
  const Eigen::Matrix2d edge = aperture.Grown(kMarginPx + kGapPx + aperture.ring_px);
  const int count =
      2 * std::clamp(  // each has an opposite one
              static_cast<int>(std::numbers::pi * (aperture.b + kMarginPx + kGapPx) / kArcPx),
              kMinArcs / 2, kMaxArcs / 2);
  arcs_.assign(static_cast<size_t>(count), Arc());
  struct RingPixel {
    float turn;  // 0 to count
    Eigen::Vector3f grey;
  };
  std::vector<RingPixel> pixels;
  for (int y = window_.y; y < window_.y + window_.height; ++y) {
    for (int x = window_.x; x < window_.x + window_.width; ++x) {
      const Eigen::Vector2d d(x - aperture.centre_px.x(), y - aperture.centre_px.y());
      if (d.dot(ring * d) <= 1 || d.dot(edge * d) >= 1) continue;
      const double turn = (std::atan2(d.y(), d.x()) / (2 * std::numbers::pi) + 0.5) * count;
      pixels.push_back({static_cast<float>(turn), Grey(image, x, y)});
    }
  }
  if (pixels.size() < kMinRingPixels) return false;
  const int channels = image.format == PixelFormat::kMono8 ? 1 : 3;
  // What looks like the marker in its ring is the next marker.
  Eigen::Vector3f middle = Eigen::Vector3f::Zero();
  for (int c = 0; c < channels; ++c) {
    residuals_.clear();
    for (const RingPixel& pixel : pixels) residuals_.push_back(pixel.grey[c]);
    middle[c] = Median(&residuals_);
  }
  const Eigen::Vector3f plateau = centre->plateau_grey.cast<float>();
  const float alike = kAlike * (plateau - middle).norm();
  std::erase_if(pixels, [&](const RingPixel& p) { return (p.grey - plateau).norm() < alike; });
  if (pixels.size() < kMinRingPixels / 2) return false;
  residuals_.clear();
  for (int k = 0; k < count; ++k) {
    for (auto& values : values_) values.clear();
    for (const RingPixel& pixel : pixels) {
      const float away =
          std::remainder(pixel.turn - static_cast<float>(k) - 0.5f, static_cast<float>(count));
      if (std::abs(away) > 0.8f) continue;
      for (int c = 0; c < channels; ++c) values_[c].push_back(pixel.grey[c]);
    }
    Arc& arc = arcs_[static_cast<size_t>(k)];
    arc.pixels = static_cast<int>(values_[0].size());
    if (arc.pixels == 0) continue;
    for (int c = 0; c < channels; ++c) {
      arc.background[c] = Median(&values_[c]);
      for (const float value : values_[c]) {
        residuals_.push_back(std::abs(value - arc.background[c]));
      }
    }
  }
  // Arcs without a pixel, outside of the picture or hidden by a neighbour, are like the nearest
  // one.
  const std::vector<Arc> read = arcs_;
  for (int k = 0; k < count; ++k) {
    for (int step = 0; step <= count / 2 && arcs_[static_cast<size_t>(k)].pixels == 0; ++step) {
      const Arc& before = read[static_cast<size_t>((k - step + count) % count)];
      const Arc& after = read[static_cast<size_t>((k + step) % count)];
      arcs_[static_cast<size_t>(k)] = before.pixels >= after.pixels ? before : after;
    }
  }
  centre->noise_grey = NoiseSigma(&residuals_);
  return true;
}

bool MarkerMeter::Cover(const ImageView& image, const Aperture& aperture, MarkerCentre* centre) {
  const auto size = static_cast<size_t>(window_.width) * static_cast<size_t>(window_.height);
  coverage_.resize(size);
  gain_.resize(size);
  arc_of_.resize(size);
  foreign_.resize(size);
  const Eigen::Vector3f plateau = centre->plateau_grey.cast<float>();
  double contrast = 0;
  for (const Arc& arc : arcs_) {
    contrast += static_cast<double>((plateau - arc.background).norm());
  }
  centre->contrast_grey = contrast / static_cast<double>(arcs_.size());
  if (!(centre->contrast_grey > kMinContrast)) return false;
  const auto least = static_cast<float>(0.3 * centre->contrast_grey);
  const auto strange = static_cast<float>(kStrange * centre->contrast_grey);
  size_t i = 0;
  for (int y = window_.y; y < window_.y + window_.height; ++y) {
    for (int x = window_.x; x < window_.x + window_.width; ++x, ++i) {
      const Eigen::Vector2d d(x - aperture.centre_px.x(), y - aperture.centre_px.y());
      size_t arc = 0;
      const Eigen::Vector3f background = Background(d, &arc);
      const Eigen::Vector3f range = plateau - background;
      const float squared = std::max(range.squaredNorm(), least * least);
      const Eigen::Vector3f above = Grey(image, x, y) - background;
      const float share = above.dot(range) / squared;
      const float counted = (share - kFree) / (kCovered - kFree);
      coverage_[i] = std::clamp(counted, 0.0f, 1.0f);
      gain_[i] = counted > 0 && counted < 1 ? 1 / (std::sqrt(squared) * (kCovered - kFree)) : 0;
      foreign_[i] = std::abs(share) > kForeign ? kBright : 0;
      if ((above - share * range).squaredNorm() > strange * strange) foreign_[i] |= kOtherColour;
      arc_of_[i] = static_cast<uint16_t>(arc);
    }
  }
  return true;
}

bool MarkerMeter::Outline(const Aperture& aperture, Blob* blob) const {
  const Eigen::Matrix2d grown = aperture.Grown(1);
  const float half = (0.5f - kFree) / (kCovered - kFree);
  double count = 0;
  Eigen::Vector2d first = Eigen::Vector2d::Zero();
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero();
  size_t i = 0;
  for (int y = window_.y; y < window_.y + window_.height; ++y) {
    for (int x = window_.x; x < window_.x + window_.width; ++x, ++i) {
      const Eigen::Vector2d d(x - aperture.centre_px.x(), y - aperture.centre_px.y());
      if (coverage_[i] < half || (foreign_[i] & kOtherColour) != 0 || d.dot(grown * d) > 1) {
        continue;
      }
      ++count;
      first += d;
      second += d * d.transpose();
    }
  }
  if (count < 4) return false;
  first /= count;
  blob->centre_px = aperture.centre_px + first;
  blob->second_moment_px2 = second / count - first * first.transpose();
  blob->area_px = static_cast<int>(count);
  return true;
}

void MarkerMeter::Block(const Aperture& aperture) {
  const Eigen::Matrix2d outline = aperture.Grown(0), own = aperture.Grown(kOwnPx);
  const Eigen::Matrix2d reach = aperture.Grown(kMarginPx + kGapPx);
  const auto for_outside = [&](auto&& visit) {
    size_t i = 0;
    for (int y = window_.y; y < window_.y + window_.height; ++y) {
      for (int x = window_.x; x < window_.x + window_.width; ++x, ++i) {
        const Eigen::Vector2d d(x - aperture.centre_px.x(), y - aperture.centre_px.y());
        if (d.dot(outline * d) > 1 && d.dot(reach * d) < 1) visit(i, d.dot(own * d) > 1);
      }
    }
  };
  const size_t count = arcs_.size();
  for_outside([&](size_t i, bool beyond) {
    if ((foreign_[i] & kOtherColour) == 0 && !(beyond && foreign_[i] != 0)) return;
    for (const size_t side : {size_t{0}, count / 2}) {
      for (size_t k = count - 1; k <= count + 1; ++k) {
        arcs_[(arc_of_[i] + side + k) % count].blocked = true;
      }
    }
  });
  for_outside([&](size_t i, bool) {
    if (arcs_[arc_of_[i]].blocked) coverage_[i] = gain_[i] = 0;
  });
}

bool MarkerMeter::FindCentroid(Aperture* aperture, MarkerCentre* centre) {
  const Eigen::Vector2d origin = aperture->centre_px;
  size_t i = 0;
  const Eigen::Matrix2d grown = aperture->Grown(kMarginPx);
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    double sum = 0;
    Eigen::Vector2d first = Eigen::Vector2d::Zero();
    i = 0;
    for (int y = window_.y; y < window_.y + window_.height; ++y) {
      for (int x = window_.x; x < window_.x + window_.width; ++x, ++i) {
        const Eigen::Vector2d d(x - aperture->centre_px.x(), y - aperture->centre_px.y());
        const double share = aperture->Weight(d, grown) * static_cast<double>(coverage_[i]);
        sum += share;
        first += share * d;
      }
    }
    if (!(sum > 1)) return false;
    const Eigen::Vector2d step = first / sum;
    aperture->centre_px += step;
    if (!((aperture->centre_px - origin).norm() < aperture->a)) return false;
    if (step.squaredNorm() < 1e-8) break;
  }
  centre->centre_px = aperture->centre_px;
  return true;
}

void MarkerMeter::MeasureShape(const Aperture& aperture, MarkerCentre* centre) {
  const Eigen::Matrix2d grown = aperture.Grown(kMarginPx);
  double sum = 0, noise6 = 0;
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero(), noise = Eigen::Matrix2d::Zero();
  Eigen::Vector4d third = Eigen::Vector4d::Zero();  // xxx, xxy, xyy, yyy
  std::vector<Eigen::Vector2d> by_arc(arcs_.size(), Eigen::Vector2d::Zero());
  size_t i = 0;
  for (int y = window_.y; y < window_.y + window_.height; ++y) {
    for (int x = window_.x; x < window_.x + window_.width; ++x, ++i) {
      const Eigen::Vector2d d(x - aperture.centre_px.x(), y - aperture.centre_px.y());
      const double weight = aperture.Weight(d, grown);
      if (weight <= 0) continue;
      const double coverage = static_cast<double>(coverage_[i]), share = weight * coverage;
      const Eigen::Matrix2d square = d * d.transpose();
      sum += share;
      second += share * square;
      third += share * Eigen::Vector4d(d.x() * square(0, 0), d.y() * square(0, 0),
                                       d.x() * square(1, 1), d.y() * square(1, 1));
      const double gain = weight * static_cast<double>(gain_[i]);
      noise += gain * gain * square;
      noise6 += gain * gain * std::pow(d.squaredNorm(), 3);
      by_arc[arc_of_[i]] +=
          gain *
          (1 - static_cast<double>(kFree) - static_cast<double>(kCovered - kFree) * coverage) * d;
    }
  }
  // What the background's own noise does, which all pixels of an arc share; neighbouring arcs
  // overlap.
  constexpr double kOverlap = 1.6;
  for (size_t k = 0; k < arcs_.size(); ++k) {
    noise += kOverlap * kMedianVariance / std::max(1, arcs_[k].pixels) * by_arc[k] *
             by_arc[k].transpose();
  }
  const double variance = centre->noise_grey * centre->noise_grey;
  centre->covariance_px2 = variance / (sum * sum) * noise;
  centre->second_moment_px2 = second / sum;
  centre->radius_px = std::sqrt(sum / std::numbers::pi);
  const double scale = 1 / (sum * std::pow(centre->radius_px, 3));
  // Each mixed moment stands for three equal ones of the tensor.
  centre->skewness = scale * std::sqrt(third.dot(third.cwiseProduct(Eigen::Vector4d(1, 3, 3, 1))));
  centre->skewness_sigma = std::sqrt(variance * noise6) * scale;
  // What makes a sphere's image lopsided, such as an edge of the background along its outline, has
  // moved its centroid too.
  const double disturbed_px = kShiftPerSkewness * centre->radius_px *
                              std::max(0.0, centre->skewness - 2.5 * centre->skewness_sigma);
  centre->covariance_px2 += disturbed_px * disturbed_px * Eigen::Matrix2d::Identity();
  centre->spread = 4 * std::numbers::pi *
                   std::sqrt(std::max(0.0, centre->second_moment_px2.determinant())) / sum;
}

bool MarkerMeter::Measure(const ImageView& image, const Blob& blob, MarkerCentre* centre) {
  *centre = MarkerCentre();
  Blob outlined = blob;
  for (const bool last : {false, true}) {
    Aperture aperture(outlined);
    if (!PlaceWindow(image, aperture, centre) || !ReadPlateau(image, aperture, centre) ||
        !ReadBackground(image, aperture, centre) || !Cover(image, aperture, centre)) {
      return false;
    }
    if (!last) {
      if (!Outline(aperture, &outlined)) return false;
      continue;
    }
    Block(aperture);
    if (!FindCentroid(&aperture, centre)) return false;
    MeasureShape(aperture, centre);
  }
  return centre->centre_px.allFinite() && centre->covariance_px2.allFinite() &&
         std::isfinite(centre->skewness) && std::isfinite(centre->spread);
}

}  // namespace rigcal::agent
