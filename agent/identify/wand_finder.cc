// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_finder.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <tuple>

#include "common/camera/camera_model.h"
#include "common/camera/sphere_projection.h"

namespace rigcal::agent {
namespace {

constexpr double kCellPx = 32;  // side of a cell of the grid over flat_px
constexpr int kMaxGridSide = 512;
constexpr double kMaxCost = 60;       // chi-squared; occluded markers cost more than they should
constexpr double kMinFill = 0.6;      // area over that of the ellipse with the same moments
constexpr double kMaxElongation = 4;  // of a sphere that moves during the exposure
// One sigma of a blob's centre, and of its radius: px plus a share of the radius.
constexpr double kPlacePx = 0.4, kPlaceShare = 0.1;
constexpr double kRadiusPx = 0.35, kRadiusShare = 0.1;
constexpr double kGate = 4;  // sigmas from the expected place
// Possible ends, the most alike in size first: bounds the work with hundreds of blobs.
constexpr size_t kMaxPairs = 20000;
// One sigma between a wand's markers (log of brightness; colour), and the largest chi-squared.
constexpr float kPairBrightnessSigma = 0.42f, kPairColourSigma = 0.21f, kMaxUnlikeness = 12;
// Weight of unlikeness and doubts against the logarithm of the radii's ratio, to sort pairs.
constexpr float kUnlikenessShare = 0.1f;

double PlaceSigma(double radius_px) { return kPlacePx + kPlaceShare * radius_px; }

// Returns the position between the ends of a line's image (0 to 1) of the point at `share` of the
// line, if the last end is `ratio` times as deep as the first.
double ImageShare(double share, double ratio) { return share * ratio / (1 + (ratio - 1) * share); }

}  // namespace

void WandLimits::Check(FaultList* faults) const {
  faults->CheckRange("min_distance", min_distance_m, 0.01, 1000);
  faults->CheckRange("max_distance", max_distance_m, 0.01, 1000);
  if (!(min_distance_m < max_distance_m)) {
    faults->Add("min_distance (", min_distance_m, " m) must be less than max_distance (",
                max_distance_m, " m)");
  }
  faults->CheckRange("max_tilt", max_tilt_deg, 10, 89);
  faults->CheckRange("min_confidence", min_confidence, 0, 1);
}

bool SameBlobs(const absl::InlinedVector<int, 3>& a, const absl::InlinedVector<int, 3>& b) {
  return std::is_permutation(a.begin(), a.end(), b.begin(), b.end());
}

absl::Status CheckTargetAndCamera(const Target& target, const CameraDescription& camera) {
  absl::Status status = target.Validate();
  if (camera.intrinsics) status.Update(camera.intrinsics->Validate(camera.image_size_px));
  return status;
}

WandFinder::WandFinder(const WandFinderOptions& options, const Target& target,
                       const CameraDescription& camera)
    : options_(options) {
  const bool calibrated = camera.intrinsics.has_value();
  if (calibrated) {
    intrinsics_ = *camera.intrinsics;
  } else {
    const ImageSize size = camera.image_size_px;
    intrinsics_.fx_px = intrinsics_.fy_px = std::max(size.width, size.height);
    intrinsics_.cx_px = 0.5 * (size.width - 1.0);
    intrinsics_.cy_px = 0.5 * (size.height - 1.0);
  }
  rays_ = std::make_shared<const RayTable>(intrinsics_, camera.image_size_px);
  focal_px_ = std::sqrt(intrinsics_.fx_px * intrinsics_.fy_px);
  length_m_ = std::max(target.marker_positions_m.back(), 1e-6);
  for (const double position_m : target.marker_positions_m) {
    shares_.push_back(position_m / length_m_);
  }
  fit_options_.diameter_m = calibrated ? target.diameter_m : 0;
  fit_options_.span_sigma_m = target.span_tolerance_m;
  // An assumed lens knows distances only up to a factor, and bends lines.
  const double slack = calibrated ? 1 : 2.5;
  if (!calibrated) fit_options_.span_sigma_m += 0.01 * length_m_;
  fit_options_.min_distance_m = options.limits.min_distance_m / slack;
  fit_options_.max_distance_m = options.limits.max_distance_m * slack;
  fit_options_.max_tilt_rad = options.limits.max_tilt_deg * std::numbers::pi / 180;
}

bool WandFinder::Sight(const Eigen::Vector2d& centre_px, MarkerSight* sight) const {
  Eigen::Vector2d normalised;
  Eigen::Matrix<double, 2, 3> d_pixel_d_ray;
  if (!rays_->RayOf(centre_px, &normalised, &d_pixel_d_ray)) return false;
  const Eigen::Vector3d point = normalised.homogeneous(), ray = point.normalized();
  d_pixel_d_ray *= point.norm();
  const Eigen::Vector3d across = ray.unitOrthogonal();
  Eigen::Matrix<double, 3, 2> plane;
  plane << across, ray.cross(across);
  const double scale = std::sqrt(std::abs((d_pixel_d_ray * plane).determinant()));
  if (!(scale > 1e-6 * focal_px_) || !std::isfinite(scale)) return false;
  sight->ray = ray;
  sight->scale_px = scale;
  return true;
}

bool WandFinder::ImageOf(const Eigen::Vector3d& point, Eigen::Vector2d* pixel) const {
  return Project(intrinsics_, point, pixel) && rays_->HasRay(*pixel);
}

void WandFinder::ToSphereCentre(const WandImageFit& fit, size_t marker,
                                MarkerObservation* observed) const {
  if (!(fit_options_.diameter_m > 0) || shares_.size() < 2) return;
  const double distance_m = (fit.first_m + shares_[marker] * (fit.last_m - fit.first_m)).norm();
  if (SphereCentreFromCentroid(intrinsics_, observed->centre_px, distance_m,
                               fit_options_.diameter_m, &observed->centre_px)) {
    observed->centre_kind = CentreKind::kSphereCentre;
  }
}

void WandFinder::AddEntry(int index, const Blob& blob, int kind) {
  Entry entry;
  entry.blob = index;
  entry.kind = kind;
  const Eigen::Matrix2d second =
      blob.second_moment_px2 + Eigen::Matrix2d::Identity() / 12;  // a pixel's own extent
  const double determinant = second.determinant();
  const double area = blob.area_px;
  if (!(determinant > 0)) return;
  const double trace = second.trace();
  const double root = std::sqrt(std::max(0.0, 0.25 * trace * trace - determinant));
  const double squared_elongation = (0.5 * trace + root) / std::max(1e-9, 0.5 * trace - root);
  if (area >= 12 && (area < kMinFill * 4 * std::numbers::pi * std::sqrt(determinant) ||
                     squared_elongation > kMaxElongation * kMaxElongation)) {
    return;
  }
  if (!Sight(blob.centre_px, &entry.sight)) return;
  const double radius = std::sqrt(area / std::numbers::pi);
  entry.sight.radius_px = radius;
  entry.sight.radius_sigma_px = kRadiusPx + kRadiusShare * radius;
  entry.sight.sigma_px = PlaceSigma(radius);
  entry.flat_px = focal_px_ * entry.sight.ray.hnormalized();
  entries_.push_back(entry);
}

void WandFinder::FillCells() {
  Eigen::Vector2d low = entries_[0].flat_px, high = low;
  for (const Entry& entry : entries_) {
    low = low.cwiseMin(entry.flat_px);
    high = high.cwiseMax(entry.flat_px);
  }
  grid_origin_ = low;
  const auto side = [](double extent) {
    return std::clamp(static_cast<int>(std::min(extent / kCellPx, 1e6)) + 1, 1, kMaxGridSide);
  };
  grid_width_ = side(high.x() - low.x());
  grid_height_ = side(high.y() - low.y());
  const auto cell = [&](const Entry& entry) {
    const Eigen::Vector2d p = (entry.flat_px - grid_origin_) / kCellPx;
    const int x = static_cast<int>(std::clamp(p.x(), 0.0, grid_width_ - 1.0));
    const int y = static_cast<int>(std::clamp(p.y(), 0.0, grid_height_ - 1.0));
    return static_cast<size_t>(y * grid_width_ + x);
  };
  cell_first_.assign(static_cast<size_t>(grid_width_) * static_cast<size_t>(grid_height_) + 1, 0);
  for (const Entry& entry : entries_) ++cell_first_[cell(entry) + 1];
  for (size_t i = 1; i < cell_first_.size(); ++i) cell_first_[i] += cell_first_[i - 1];
  cell_entries_.resize(entries_.size());
  std::vector<int> next(cell_first_.begin(), cell_first_.end() - 1);
  for (size_t i = 0; i < entries_.size(); ++i) {
    cell_entries_[static_cast<size_t>(next[cell(entries_[i])]++)] = static_cast<int>(i);
  }
}

float WandFinder::Unlikeness(const Entry& a, const Entry& b) {
  const float brighter = (a.brightness - b.brightness) / kPairBrightnessSigma;
  return brighter * brighter +
         (a.colour - b.colour).squaredNorm() / (kPairColourSigma * kPairColourSigma);
}

bool WandFinder::EndsPossible(const Entry& a, const Entry& b) const {
  const double ra = a.sight.radius_px, rb = b.sight.radius_px;
  if (ra > 2.5 * rb + 2 || rb > 2.5 * ra + 2) return false;
  const double width = (a.sight.ray - b.sight.ray).norm();
  if (!(width > 1e-6)) return false;
  // Seen across, the wand is not longer than it is, and not nearer than allowed.
  if (width * fit_options_.min_distance_m > 1.2 * length_m_) return false;
  if (!(fit_options_.diameter_m > 0)) return true;
  const double scale = 0.5 * (a.sight.scale_px + b.sight.scale_px);
  const double full = 0.5 * fit_options_.diameter_m * scale * width / length_m_;  // no tilt
  const double shortest = full / std::max(0.02, std::cos(fit_options_.max_tilt_rad));
  const double radius = 0.5 * (ra + rb);
  return 1.6 * radius + 1 >= full && 0.6 * radius - 1.5 <= shortest;
}

void WandFinder::ListPairs() {
  pairs_.clear();
  for (size_t i = 0; i < entries_.size(); ++i) {
    for (size_t j = i + 1; j < entries_.size(); ++j) {
      if (!CanBeEnds(entries_[i], entries_[j]) && !CanBeEnds(entries_[j], entries_[i])) continue;
      const float unlikeness = Unlikeness(entries_[i], entries_[j]);
      if (unlikeness > kMaxUnlikeness || !EndsPossible(entries_[i], entries_[j])) continue;
      const double ratio = std::log(entries_[i].sight.radius_px / entries_[j].sight.radius_px);
      const auto doubt = static_cast<float>(entries_[i].doubt + entries_[j].doubt);
      pairs_.push_back(
          {static_cast<float>(std::abs(ratio)) + kUnlikenessShare * (unlikeness + doubt),
           static_cast<int>(i), static_cast<int>(j)});
    }
  }
  std::sort(pairs_.begin(), pairs_.end(), [](const Pair& a, const Pair& b) {
    return std::tie(a.unlikeness, a.first, a.last) < std::tie(b.unlikeness, b.first, b.last);
  });
  pairs_.resize(std::min(pairs_.size(), kMaxPairs));
}

void WandFinder::Near(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double reach_px,
                      std::vector<int>* found) const {
  found->clear();
  const Eigen::Array2d reach(reach_px, reach_px);
  const Eigen::Array2d low = (from.cwiseMin(to).array() - reach - grid_origin_.array()) / kCellPx;
  const Eigen::Array2d high = (from.cwiseMax(to).array() + reach - grid_origin_.array()) / kCellPx;
  const auto index = [](double value, int size) {
    return static_cast<int>(std::clamp(std::floor(value), 0.0, size - 1.0));
  };
  const Eigen::Vector2d piece = to - from;
  const double squared = std::max(piece.squaredNorm(), 1e-12);
  for (int y = index(low.y(), grid_height_); y <= index(high.y(), grid_height_); ++y) {
    for (int x = index(low.x(), grid_width_); x <= index(high.x(), grid_width_); ++x) {
      const auto cell = static_cast<size_t>(y * grid_width_ + x);
      for (int k = cell_first_[cell]; k < cell_first_[cell + 1]; ++k) {
        const int entry = cell_entries_[static_cast<size_t>(k)];
        const Eigen::Vector2d p = entries_[static_cast<size_t>(entry)].flat_px - from;
        const double share = std::clamp(p.dot(piece) / squared, 0.0, 1.0);
        if ((p - share * piece).squaredNorm() <= reach_px * reach_px) found->push_back(entry);
      }
    }
  }
}

void WandFinder::SearchBetween(const Entry& first, const Entry& last) {
  if (shares_.size() == 2) return Offer({IndexOf(first), IndexOf(last)});
  // Limits of the last end's depth over the first one's: by the steepest tilt, and by the sizes.
  const double width = (first.sight.ray - last.sight.ray).norm();
  const double half = std::min(0.6, 0.5 * width * std::tan(fit_options_.max_tilt_rad));
  const double r0 = first.sight.radius_px, r1 = last.sight.radius_px;
  const double low = std::max((1 - half) / (1 + half), (0.65 * r0 - 0.7) / (r1 + 0.7));
  const double high =
      std::min((1 + half) / (1 - half), (r0 + 0.7) / std::max(0.2, 0.65 * r1 - 0.7));
  if (!(low <= high)) return;
  const double depth = last.sight.ray.z() / first.sight.ray.z();
  const Eigen::Vector2d line = last.flat_px - first.flat_px;
  const double sigma =
      PlaceSigma(0.5 * (r0 + r1)) + fit_options_.span_sigma_m / length_m_ * line.norm();
  // Away from the image's middle flat pixels are wider than the camera's.
  const double stretch = focal_px_ / (first.sight.scale_px * std::pow(first.sight.ray.z(), 2));
  const double reach = kGate * sigma * std::clamp(stretch, 1.0, 4.0);
  Near(first.flat_px + ImageShare(shares_[1], low * depth) * line,
       first.flat_px + ImageShare(shares_[1], high * depth) * line, reach, &between_);
  const std::vector<int> found = between_;
  for (const int second : found) {
    const Entry& entry = entries_[static_cast<size_t>(second)];
    if (&entry == &first || &entry == &last || !CanBe(entry, 1)) continue;
    if (std::max(Unlikeness(entry, first), Unlikeness(entry, last)) > kMaxUnlikeness) continue;
    const double r = entry.sight.radius_px;
    if (r > 1.6 * std::max(r0, r1) + 1.2 || r < 0.55 * std::min(r0, r1) - 1) continue;
    if (shares_.size() == 3) {
      Offer({IndexOf(first), second, IndexOf(last)});
    } else {
      Complete(first, entry, last);
    }
  }
}

void WandFinder::Complete(const Entry& first, const Entry& second, const Entry& last) {
  const Eigen::Vector2d line = last.flat_px - first.flat_px;
  const double q =
      std::clamp((second.flat_px - first.flat_px).dot(line) / line.squaredNorm(), 0.01, 0.99);
  const double ratio = q * (1 - shares_[1]) / (shares_[1] * (1 - q));
  absl::InlinedVector<int, 3> chosen = {IndexOf(first), IndexOf(second)};
  // The ratio carries the second marker's error, which weighs more in the middle of the wand.
  const double error =
      PlaceSigma(second.sight.radius_px) + fit_options_.span_sigma_m / length_m_ * line.norm();
  for (size_t k = 2; k + 1 < shares_.size(); ++k) {
    const double lever = shares_[k] * (1 - shares_[k]) / (shares_[1] * (1 - shares_[1]));
    const Eigen::Vector2d expected = first.flat_px + ImageShare(shares_[k], ratio) * line;
    Near(expected, expected, kGate * error * (1 + lever), &between_);
    int best = -1;
    double nearest = 0;
    for (const int candidate : between_) {
      if (std::find(chosen.begin(), chosen.end(), candidate) != chosen.end() ||
          candidate == IndexOf(last) || !CanBe(entries_[static_cast<size_t>(candidate)], k)) {
        continue;
      }
      const double distance =
          (entries_[static_cast<size_t>(candidate)].flat_px - expected).squaredNorm();
      if (best < 0 || distance < nearest) {
        best = candidate;
        nearest = distance;
      }
    }
    if (best < 0) return;
    chosen.push_back(best);
  }
  chosen.push_back(IndexOf(last));
  Offer(chosen);
}

void WandFinder::Offer(const absl::InlinedVector<int, 3>& entries) {
  if (fits_ >= options_.max_fits) return;
  ++fits_;
  absl::InlinedVector<MarkerSight, 4> sights;
  WandCandidate candidate;
  for (const int entry : entries) {
    sights.push_back(entries_[static_cast<size_t>(entry)].sight);
    candidate.blobs.push_back(entries_[static_cast<size_t>(entry)].blob);
  }
  if (!FitWand(sights, shares_, length_m_, fit_options_, &candidate.fit)) return;
  if (!(candidate.fit.cost <= kMaxCost)) return;
  candidate.cost = candidate.fit.cost;
  for (const int entry : entries) candidate.cost += entries_[static_cast<size_t>(entry)].doubt;
  const auto order = [](const WandCandidate& a, const WandCandidate& b) {
    return std::tie(a.cost, a.blobs) < std::tie(b.cost, b.blobs);
  };
  candidates_.insert(std::upper_bound(candidates_.begin(), candidates_.end(), candidate, order),
                     candidate);
  if (static_cast<int>(candidates_.size()) > options_.max_candidates) candidates_.pop_back();
}

const std::vector<WandCandidate>& WandFinder::Find(absl::Span<const Blob> blobs,
                                                   absl::Span<const int> kinds,
                                                   absl::Span<const Eigen::Vector3f> colours,
                                                   absl::Span<const double> doubts) {
  candidates_.clear();
  entries_.clear();
  fits_ = 0;
  for (size_t i = 0; i < blobs.size(); ++i) {
    AddEntry(static_cast<int>(i), blobs[i], i < kinds.size() ? kinds[i] : 0);
    if (entries_.empty() || entries_.back().blob != static_cast<int>(i)) continue;
    if (i < doubts.size()) entries_.back().doubt = doubts[i];
    if (i >= colours.size()) continue;
    const float brightness = std::max(1.0f, colours[i].norm());
    entries_.back().colour = colours[i] / brightness;
    entries_.back().brightness = std::log(brightness);
  }
  if (shares_.size() == 1) {
    for (const Entry& entry : entries_) {
      if (!CanBe(entry, 0)) continue;
      candidates_.push_back({.blobs = {entry.blob}, .fit = {}});
    }
    return candidates_;
  }
  if (entries_.size() < shares_.size()) return candidates_;
  FillCells();
  ListPairs();
  least_cost_left_ = std::numeric_limits<double>::infinity();
  for (const Pair& pair : pairs_) {
    if (fits_ >= options_.max_fits) {
      least_cost_left_ = static_cast<double>(pair.unlikeness / kUnlikenessShare);
      break;
    }
    const Entry& a = entries_[static_cast<size_t>(pair.first)];
    const Entry& b = entries_[static_cast<size_t>(pair.last)];
    if (CanBeEnds(a, b)) SearchBetween(a, b);
    if (CanBeEnds(b, a)) SearchBetween(b, a);
  }
  return candidates_;
}

}  // namespace rigcal::agent
