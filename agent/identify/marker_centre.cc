// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/marker_centre.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace rigcal::agent {
namespace {

// A pixel with coverage up to kFree counts as background, from kCovered on as marker.
constexpr float kFree = 0.22f, kCovered = 0.8f;
constexpr float kStrange = 0.3f;     // of the contrast: farther from all mixtures is another colour
constexpr int kLeastOutlinePx = 4;   // pixels of a blob
constexpr double kCore = 0.55;       // of the blob's semi-axes: the plateau is read inside
constexpr double kWideCore = 0.85;   // of the semi-axes: saturated pixels are counted inside
constexpr double kMinContrast = 12;  // grey levels, over all channels
constexpr double kUsualStep = 1.2;   // root mean square of usual steps over their mean
constexpr double kMostSaturated = 0.04;  // share of pixels; more make a channel saturated
// Pixels this far outside of the blob with more coverage than kForeign belong to something else.
constexpr double kOwnPx = 1.5;
constexpr float kForeign = 0.4f;
constexpr float kAlikeAbove = 0.6f, kAlikeBelow = 1.5f;  // coverage of what looks like the marker
enum Foreign : uint8_t { kBright = 1, kOtherColour = 2 };
constexpr int kMaxIterations = 12;
constexpr double kWeightPx = 1.5;  // beyond an ellipse, where MarkerAperture::Weight is 0
// Shift of the centroid in radii per unit of skewness, found on rendered images.
constexpr double kShiftPerSkewness = 4;
constexpr double kMedianVariance = 1.57;  // of a Gaussian's median, over that of its mean (pi / 2)
constexpr double kArcPx = 3;              // length of an arc of the background
constexpr double kFullRadiusPx = 16;  // larger semi-axes b are read in steps of b / 16 px, up to 3

struct PixelMoments {
  int count = 0;
  Eigen::Vector2d first = Eigen::Vector2d::Zero();
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero();

  void Add(const Eigen::Vector2d& d) {
    ++count;
    first += d;
    second += d * d.transpose();
  }
  Eigen::Vector2d Mean() const { return first / count; }
  Eigen::Matrix2d Moment() const { return second / count - Mean() * Mean().transpose(); }
};

}  // namespace

int MarkerMeter::StepOf(const MarkerAperture& aperture) {
  return std::clamp(static_cast<int>(aperture.b / kFullRadiusPx), 1, 3);
}

PixelGrid MarkerMeter::GridAround(const ImageView& image, const MarkerAperture& aperture,
                                  double reach_px) {
  const Eigen::Vector2d& at = aperture.centre_px;
  PixelRect rect;
  rect.x = std::max(static_cast<int>(std::floor(at.x() - reach_px)), 0);
  rect.y = std::max(static_cast<int>(std::floor(at.y() - reach_px)), 0);
  rect.width = std::min(static_cast<int>(std::ceil(at.x() + reach_px)) + 1, image.width) - rect.x;
  rect.height = std::min(static_cast<int>(std::ceil(at.y() + reach_px)) + 1, image.height) - rect.y;
  return {rect, StepOf(aperture)};
}

double MarkerMeter::WorkOf(const Blob& blob) {
  const MarkerAperture aperture(blob);
  const double side = 2 * aperture.Reach() / StepOf(aperture);
  return side * side;
}

bool MarkerMeter::PlaceWindow(const ImageView& image, const MarkerAperture& aperture,
                              MarkerCentre* centre) {
  const Eigen::Vector2d& at = aperture.centre_px;
  // The border may cut the ring, but not the ellipse of the blob and 1 px around it.
  const double need = aperture.a + 1;
  centre->cut = at.x() - need < 0 || at.y() - need < 0 || at.x() + need > image.width - 1 ||
                at.y() + need > image.height - 1;
  window_ = GridAround(image, aperture, aperture.Reach());
  return !window_.rect.empty();
}

bool MarkerMeter::ReadPlateau(const ImageView& image, const MarkerAperture& aperture,
                              MarkerCentre* centre) const {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  int count = 0, wide_count = 0;
  std::array<int, 3> saturated{};
  const Eigen::Matrix2d wide = aperture.shape / (kWideCore * kWideCore);
  ForEllipse(window_, aperture.centre_px, wide,
             [&](size_t, int x, int y, const Eigen::Vector2d& d) {
               const double squared = d.dot(aperture.shape * d);
               if (squared >= kWideCore * kWideCore) return;
               const Eigen::Vector3f grey = GreyAt(image, x, y);
               ++wide_count;
               for (size_t c = 0; c < 3; ++c)
                 saturated[c] += grey[static_cast<int>(c)] >= kSaturatedGrey ? 1 : 0;
               if (squared >= kCore * kCore) return;
               sum += grey;
               ++count;
             });
  if (count == 0) return false;
  for (size_t c = 0; c < 3; ++c) {
    centre->saturated[c] = saturated[c] > kMostSaturated * wide_count;
  }
  centre->plateau_grey = (sum / static_cast<float>(count)).cast<double>();
  return true;
}

bool MarkerMeter::Cover(const ImageView& image, const MarkerAperture& aperture,
                        MarkerCentre* centre) {
  const std::vector<RingBackground::Arc>& arcs = background_.arcs();
  const size_t size = window_.size();
  coverage_.resize(size);
  share_.resize(size);
  gain_.resize(size);
  arc_of_.resize(size);
  foreign_.resize(size);
  const Eigen::Vector3f plateau = centre->plateau_grey.cast<float>();
  double contrast = 0, saturated = 0;
  for (const RingBackground::Arc& arc : arcs) {
    const Eigen::Array3f range = plateau - arc.background;
    contrast += static_cast<double>(range.matrix().norm());
    const Eigen::Array3f clipped = (arc.background.array() >= kSaturatedGrey).cast<float>();
    saturated += static_cast<double>((clipped * range).matrix().norm());
  }
  centre->contrast_grey = contrast / static_cast<double>(arcs.size());
  centre->saturated_behind = saturated / std::max(1.0, contrast);
  double steps = 0;
  for (size_t k = 0; k < arcs.size(); ++k) {
    steps +=
        static_cast<double>((arcs[k].background - arcs[(k + 1) % arcs.size()].background).norm());
  }
  centre->background_steps =
      kUsualStep * steps / static_cast<double>(arcs.size()) / std::max(1.0, centre->contrast_grey);
  if (!(centre->contrast_grey > kMinContrast)) return false;
  const auto least = static_cast<float>(0.3 * centre->contrast_grey);
  const auto strange = static_cast<float>(kStrange * centre->contrast_grey);
  // A little beyond what is summed, because the aperture follows the centroid.
  reach_ = aperture.Grown(MarkerAperture::kMarginPx + MarkerAperture::kGapPx + 1);
  std::ranges::fill(coverage_, 0.0f);
  std::ranges::fill(gain_, 0.0f);
  std::ranges::fill(foreign_, uint8_t{0});
  std::ranges::fill(arc_of_, uint16_t{0});
  const auto cover = [&](size_t i, int x, int y, const Eigen::Vector2d& d, float turn) {
    if (d.dot(reach_ * d) > 1) return;
    size_t arc = 0;
    const Eigen::Vector3f background = background_.At(turn, &arc);
    const Eigen::Vector3f range = plateau - background;
    const float squared = std::max(range.squaredNorm(), least * least);
    const Eigen::Vector3f above = GreyAt(image, x, y) - background;
    const float share = above.dot(range) / squared;
    share_[i] = share;
    foreign_[i] = std::abs(share) > kForeign ? kBright : 0;
    if ((above - share * range).squaredNorm() > strange * strange) foreign_[i] |= kOtherColour;
    const float counted = (share - kFree) / (kCovered - kFree);
    coverage_[i] = std::clamp(counted, 0.0f, 1.0f);
    gain_[i] = counted > 0 && counted < 1 ? 1 / (std::sqrt(squared) * (kCovered - kFree)) : 0;
    arc_of_[i] = static_cast<uint16_t>(arc);
  };
  background_.ForDirections(window_, aperture.centre_px, reach_, &turns_, cover);
  return true;
}

bool MarkerMeter::Outline(const MarkerAperture& aperture, Blob* blob) {
  const Eigen::Matrix2d grown = aperture.Grown(1);
  PixelMoments covered;
  ForEllipse(window_, aperture.centre_px, grown, [&](size_t i, int, int, const Eigen::Vector2d& d) {
    if (d.dot(grown * d) > 1) return;
    if (share_[i] >= 0.5f && (foreign_[i] & kOtherColour) == 0) covered.Add(d);
  });
  if (covered.count < kLeastOutlinePx) return false;
  blob->centre_px = aperture.centre_px + covered.Mean();
  blob->second_moment_px2 = covered.Moment();
  blob->area_px = covered.count * window_.step * window_.step;
  return true;
}

void MarkerMeter::Block(const MarkerAperture& aperture) {
  std::vector<RingBackground::Arc>& arcs = background_.arcs();
  const Eigen::Matrix2d outline = aperture.Grown(0), own = aperture.Grown(kOwnPx);
  const Eigen::Matrix2d reach = aperture.Grown(MarkerAperture::kMarginPx + MarkerAperture::kGapPx);
  const auto for_outside = [&](auto&& visit) {
    ForEllipse(window_, aperture.centre_px, reach,
               [&](size_t i, int, int, const Eigen::Vector2d& d) {
                 if (d.dot(outline * d) > 1 && d.dot(reach * d) < 1) visit(i, d.dot(own * d) > 1);
               });
  };
  const size_t count = arcs.size();
  for_outside([&](size_t i, bool beyond) {
    if ((foreign_[i] & kOtherColour) == 0 && !(beyond && foreign_[i] != 0)) return;
    for (const size_t side : {size_t{0}, count / 2}) {
      for (size_t k = count - 1; k <= count + 1; ++k) {
        arcs[(arc_of_[i] + side + k) % count].blocked = true;
      }
    }
  });
  for_outside([&](size_t i, bool) {
    if (arcs[arc_of_[i]].blocked) coverage_[i] = gain_[i] = 0;
  });
}

void MarkerMeter::MeasureAround(const MarkerAperture& aperture, MarkerCentre* centre) const {
  const Eigen::Matrix2d own = aperture.Grown(kOwnPx);
  const Eigen::Matrix2d reach = aperture.Grown(MarkerAperture::kMarginPx + MarkerAperture::kGapPx);
  int count = 0, alike = 0;
  ForEllipse(window_, aperture.centre_px, reach, [&](size_t i, int, int, const Eigen::Vector2d& d) {
    if (d.dot(own * d) <= 1 || d.dot(reach * d) >= 1) return;
    ++count;
    alike += share_[i] > kAlikeAbove && share_[i] < kAlikeBelow && (foreign_[i] & kOtherColour) == 0
                 ? 1
                 : 0;
  });
  if (count > 0) centre->alike = static_cast<double>(alike) / count;
}

bool MarkerMeter::FindCentroid(MarkerAperture* aperture, MarkerCentre* centre) {
  const Eigen::Vector2d origin = aperture->centre_px;
  const Eigen::Matrix2d grown = aperture->Grown(MarkerAperture::kMarginPx);
  const Eigen::Matrix2d reach = aperture->Grown(MarkerAperture::kMarginPx + kWeightPx);
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    double sum = 0;
    Eigen::Vector2d first = Eigen::Vector2d::Zero();
    ForEllipse(
        window_, aperture->centre_px, reach, [&](size_t i, int, int, const Eigen::Vector2d& d) {
          const double share = aperture->Weight(d, grown) * static_cast<double>(coverage_[i]);
          sum += share;
          first += share * d;
        });
    if (!(sum > 1)) return false;
    const Eigen::Vector2d step = first / sum;
    aperture->centre_px += step;
    if (!((aperture->centre_px - origin).norm() < aperture->a)) return false;
    if (step.squaredNorm() < 1e-8) break;
  }
  centre->centre_px = aperture->centre_px;
  return true;
}

void MarkerMeter::MeasureShape(const MarkerAperture& aperture, MarkerCentre* centre) {
  const std::vector<RingBackground::Arc>& arcs = background_.arcs();
  const Eigen::Matrix2d grown = aperture.Grown(MarkerAperture::kMarginPx);
  const Eigen::Matrix2d reach = aperture.Grown(MarkerAperture::kMarginPx + kWeightPx);
  double sum = 0, noise6 = 0;
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero(), noise = Eigen::Matrix2d::Zero();
  Eigen::Vector4d third = Eigen::Vector4d::Zero();  // xxx, xxy, xyy, yyy
  std::vector<Eigen::Vector2d> by_arc(arcs.size(), Eigen::Vector2d::Zero());
  ForEllipse(window_, aperture.centre_px, reach, [&](size_t i, int, int, const Eigen::Vector2d& d) {
    const double weight = aperture.Weight(d, grown);
    if (weight <= 0) return;
    const double coverage = static_cast<double>(coverage_[i]), share = weight * coverage;
    const Eigen::Matrix2d square = d * d.transpose();
    sum += share;
    second += share * square;
    third += share * Eigen::Vector4d(d.x() * square(0, 0), d.y() * square(0, 0),
                                     d.x() * square(1, 1), d.y() * square(1, 1));
    const double gain = weight * static_cast<double>(gain_[i]), squared = d.squaredNorm();
    noise += gain * gain * square;
    noise6 += gain * gain * squared * squared * squared;
    by_arc[arc_of_[i]] +=
        gain * (1 - static_cast<double>(kFree) - static_cast<double>(kCovered - kFree) * coverage) *
        d;
  });
  // All pixels of an arc share the noise of its background, and neighbouring arcs share pixels.
  constexpr double kOverlap = 1.6;
  for (size_t k = 0; k < arcs.size(); ++k) {
    noise += kOverlap * kMedianVariance / std::max(1, arcs[k].pixels) * by_arc[k] *
             by_arc[k].transpose();
  }
  const double variance = centre->noise_grey * centre->noise_grey;
  centre->covariance_px2 = variance / (sum * sum) * noise;
  centre->second_moment_px2 = second / sum;
  const double area = sum * window_.step * window_.step;
  centre->radius_px = std::sqrt(area / std::numbers::pi);
  const double scale = 1 / (sum * std::pow(centre->radius_px, 3));
  // Each mixed moment stands for three equal entries of the tensor.
  centre->skewness = scale * std::sqrt(third.dot(third.cwiseProduct(Eigen::Vector4d(1, 3, 3, 1))));
  centre->skewness_sigma = std::sqrt(variance * noise6) * scale;
  // What skews a sphere's image, such as an edge behind its outline, moves its centroid too.
  const double disturbed_px = kShiftPerSkewness * centre->radius_px *
                              std::max(0.0, centre->skewness - 2.5 * centre->skewness_sigma);
  centre->covariance_px2 += disturbed_px * disturbed_px * Eigen::Matrix2d::Identity();
  centre->spread = 4 * std::numbers::pi *
                   std::sqrt(std::max(0.0, centre->second_moment_px2.determinant())) / area;
}

bool MarkerMeter::Measure(const ImageView& image, const Blob& blob, MarkerCentre* centre) {
  *centre = MarkerCentre();
  Blob outlined = blob;
  has_measured_ = false;
  for (const bool last : {false, true}) {
    MarkerAperture aperture(outlined);
    if (!PlaceWindow(image, aperture, centre) || !ReadPlateau(image, aperture, centre) ||
        !background_.Read(
            image, aperture, window_, centre->plateau_grey.cast<float>(),
            {MarkerAperture::kMarginPx + MarkerAperture::kGapPx, aperture.ring_px, kArcPx},
            last ? &centre->noise_grey : nullptr) ||
        !Cover(image, aperture, centre)) {
      return false;
    }
    if (!last) {
      if (!Outline(aperture, &outlined)) return false;
      continue;
    }
    MeasureAround(aperture, centre);
    Block(aperture);
    centre->has_neighbour =
        std::ranges::any_of(background_.arcs(), [](const auto& arc) { return arc.blocked; });
    if (!FindCentroid(&aperture, centre)) return false;
    MeasureShape(aperture, centre);
    outlined_ = aperture;
  }
  has_measured_ = centre->centre_px.allFinite() && centre->covariance_px2.allFinite() &&
                  std::isfinite(centre->skewness) && std::isfinite(centre->spread);
  return has_measured_;
}

}  // namespace rigcal::agent
