// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/wand_detector.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/detect/blobs/blob_contrast.h"
#include "agent/detect/blobs/blob_splitter.h"
#include "agent/detect/frame/colour_share.h"
#include "agent/detect/frame/image_exposure.h"
#include "agent/detect/frame/wand_track.h"
#include "agent/identify/partial_wands.h"
#include "agent/identify/wand_verifier.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// Errors besides noise: sampling, the clipped coverage, the lens between calibration points.
constexpr double kModelSigmaPx = 0.006;
constexpr int kNeverWashedOut = 256;  // ColourRange::washed_out_min
// Ranges of colour that are searched one after the other. `brighter`: from value_min to the
// brightest; `paler`: of saturation_min. Light of a room or of a window whitens the spheres, and
// what is white hides them.
struct LevelRange {
  double brighter, paler;
  bool white;  // takes what the sensor has lost the colour of
};
constexpr LevelRange kLevels[] = {{0, 1, true},   {0.2, 1, true},      {0.4, 1, true},
                                  {0.6, 1, true}, {0.35, 0.55, false}, {0, 0.55, false}};
constexpr size_t kWideLevels[] = {0, 1, 2, 3}, kPaleLevels[] = {4, 5};
constexpr int kLargeAreaPx = 800;
constexpr int kPart = 4;  // a piece that much smaller is something in front of the other

// Of wands of which a marker is hidden.
constexpr size_t kMaxWithHidden = 12, kMaxPartial = 12;
constexpr double kPartialConfidence = 0.6;
constexpr int kColouredOfNine = 3, kPaleOfNine = 6;
constexpr int kClipped = 250;

// What a search may cost; a wand in a room takes a twentieth of it.
constexpr int kMaxRuns = 12000;            // of each level, some 30 ns each
constexpr int64_t kMaxMaskedPx = 3000000;  // of boxes of patches, 0.3 ns each
constexpr int64_t kMaxSplitPx = 120000;    // of the same, 9 ns each
constexpr size_t kMaxSpots = 160;          // pairs of them, 5 ns each
constexpr int kMaxFits = 500;              // of wands to spots, 4 us each
constexpr int kFitsOfLevel = 300;
constexpr int kMaxCandidates = 200;  // that are compared by their colour
constexpr size_t kMaxMeasured = 30;  // of them
constexpr double kMaxWork = 36000;   // of MarkerMeter::WorkOf, 50 ns each
constexpr double kWorkOfLevel = 18000;
constexpr double kWhiteRoom = 0.01;  // of the pixels: more than saturated spheres
constexpr double kLeastLit = 0.02;   // of the pixels
constexpr double kLittleMs = 1;
constexpr double kNoFurtherMs = 3;  // by the times above: no other level is begun
// Of a marker's middle against the others, before it is measured.
constexpr double kAlikeDoubt = 11;  // where all around looks like it
constexpr double kLongerSigma = 0.15, kMostShapeDoubt = 4;
constexpr double kALittleWorse = 2;
constexpr double kSureCost = 4;  // of a wand; what was left out is hardly as good
constexpr float kBrightnessSigma = 0.3f, kColourSigma = 0.15f;

// The channel that is strongest in the middle of the range: 0 blue, 1 green, 2 red.
int MainChannel(const ColourRange& colour) {
  const double width = std::fmod(colour.hue_max_deg - colour.hue_min_deg + 360, 360);
  const double middle = std::fmod(colour.hue_min_deg + 0.5 * width, 360);
  return middle < 60 || middle >= 300 ? 2 : middle < 180 ? 1 : 0;
}

double ShapeDoubt(const Blob& blob) {
  const Eigen::Matrix2d second = blob.second_moment_px2 + Eigen::Matrix2d::Identity() / 12;
  const double half = 0.5 * second.trace();
  const double root = std::sqrt(std::max(0.0, half * half - second.determinant()));
  const double longer = std::sqrt((half + root) / std::max(1e-9, half - root)) - 1;
  return std::min(kMostShapeDoubt, std::pow(longer / kLongerSigma, 2));
}

// A blob that a window inside the image may have cut.
bool TouchesEdge(const PixelRect& box, const PixelRect& window, const PixelRect& bounds) {
  return (box.x <= window.x && window.x > bounds.x) || (box.y <= window.y && window.y > bounds.y) ||
         (box.x + box.width >= window.x + window.width &&
          window.x + window.width < bounds.x + bounds.width) ||
         (box.y + box.height >= window.y + window.height &&
          window.y + window.height < bounds.y + bounds.height);
}

}  // namespace

absl::Status WandDetectorOptions::Validate() const {
  FaultList faults;
  faults.Add(BlobFinderOptions::Validate());
  faults.CheckRange("max_blobs", max_blobs, 2, 4096);
  WandLimits::Check(&faults);
  faults.CheckRange("exposure", exposure_s, 0, 10);
  return faults.Result("wand detector: ");
}

WandDetector::WandDetector(const WandDetectorOptions& options, const Target& target,
                           const CameraDescription& camera)
    : options_(options),
      target_(target),
      camera_(camera),
      main_channel_(MainChannel(options.colour)),
      wand_finder_({.limits = options, .max_candidates = kMaxCandidates}, target, camera),
      verifier_(options.min_confidence),
      light_sigma_s_(LightTimeSigma(options.exposure_s, target)) {}

double WandDetector::ShareOf(int64_t count_px) const {
  return static_cast<double>(count_px) / (static_cast<double>(camera_.image_size_px.width) *
                                          static_cast<double>(camera_.image_size_px.height));
}

// More passes than a wand and some things of its colour.
bool WandDetector::IsCrowded() const {
  return result().over_limit > 0 || result().cut_short ||
         ShareOf(result().passed_px) > kCrowdedShare;
}

// By what was done, so that it is the same on every computer.
double WandDetector::EstimatedMs() const {
  return 1e-6 * (30.0 * static_cast<double>(runs_) + 4000.0 * (kMaxFits - fits_left_) +
                 50.0 * (kMaxWork - work_left_) +
                 0.3 * static_cast<double>(kMaxMaskedPx - masked_px_left_) +
                 9.0 * static_cast<double>(kMaxSplitPx - split_px_left_));
}

Verdict WandDetector::SearchAll(const ImageView& image) {
  level_ = 0;
  passed_share_ = ShareOf(levels_[0].blobs.Find(image).passed_px);
  if (passed_share_ > kWhiteRoom) {
    white_share_ = WhiteShare(image, options_.colour.washed_out_min);
  }
  const bool is_white = white_share_ > kWhiteRoom;
  Verdict verdict;
  // False: there is time for more.
  const auto search = [&](size_t level) {
    cut_short_ |= EstimatedMs() > kNoFurtherMs;
    if (EstimatedMs() > kNoFurtherMs) return true;
    verdict = Search(image, image.Bounds(), level);
    return verdict.wand.has_value() || has_rivals_;
  };
  for (const size_t level : kWideLevels) {
    if (is_white) break;
    if (search(level) && !has_rivals_) return verdict;
    // A window's slats look alike, but have no colour.
    if (has_rivals_ || !IsCrowded()) break;
  }
  // No light of a dark room whitens a sphere.
  if (!is_white && LitShare(image) < kLeastLit) return verdict;
  for (const size_t level : kPaleLevels) {
    if (search(level)) return verdict;
  }
  // Where hardly anything has a colour the spheres may be white too.
  if (is_white && EstimatedMs() < kLittleMs) search(kWideLevels[0]);
  return verdict;
}

// A part of its middle. Where the sensor is saturated in the wand's main channel its colour is
// lost.
bool WandDetector::HasColour(const ImageView& image, const Blob& blob) const {
  const double reach = 0.5 * std::sqrt(blob.area_px / std::numbers::pi);
  int passed = 0;
  for (int v = -1; v <= 1; ++v) {
    for (int u = -1; u <= 1; ++u) {
      const auto x = static_cast<int>(std::lround(blob.centre_px.x() + reach * u));
      const auto y = static_cast<int>(std::lround(blob.centre_px.y() + reach * v));
      if (x < 0 || y < 0 || x >= image.width || y >= image.height) continue;
      uint64_t word = 0;
      levels_[level_].masker.MaskRow(image, y, x / kMaskWordBits, 1, &word);
      const uint8_t* const pixel = image.Row(y) + x * BytesPerPixel(image.format);
      const bool colour = image.format == PixelFormat::kBgr8;
      // A room's white is nothing that the light of a wand has whitened.
      const bool white =
          colour && !kLevels[level_].white && std::min({pixel[0], pixel[1], pixel[2]}) >= kClipped;
      const bool clipped = !white && pixel[colour ? main_channel_ : 0] >= kClipped;
      passed += clipped || (word >> (x % kMaskWordBits) & 1) != 0 ? 1 : 0;
    }
  }
  return passed >= (kLevels[level_].white ? kColouredOfNine : kPaleOfNine);
}

void WandDetector::Keep(const ImageView& image, const Blob& blob, bool is_cut) {
  Spot spot{blob, Eigen::Vector3f::Zero(), is_cut};
  // A piece of a patch is held to the wand's colour too.
  float alike = 0;
  if (!StandsOut(image, blob, &spot.core, &alike) || !HasColour(image, blob)) return;
  spot.doubt = kAlikeDoubt * static_cast<double>(alike) + ShapeDoubt(blob);
  // The box of one blob may hold a part of another's pieces.
  for (Spot& known : spots_) {
    const int larger = std::max(known.blob.area_px, blob.area_px);
    const int smaller = std::min(known.blob.area_px, blob.area_px);
    const double squared_px2 = (known.blob.centre_px - blob.centre_px).squaredNorm();
    if (squared_px2 * std::numbers::pi >= larger) continue;
    if (kPart * smaller < larger) continue;  // not the same thing
    if (blob.area_px > known.blob.area_px) known = spot;
    return;
  }
  spots_.push_back(spot);
}

// Things that may be a marker.
void WandDetector::FindSpots(const ImageView& image, const PixelRect& part) {
  spots_.clear();
  BlobFinder& finder = levels_[level_].blobs;
  // The first one has been searched for how much passes.
  const bool is_known = level_ == 0 && part == image.Bounds();
  const BlobResult& found = is_known ? finder.result() : finder.Find(image, part);
  runs_ += found.run_count;
  const auto is_cut = [&](const Blob& blob) { return TouchesEdge(blob.box, part, image.Bounds()); };
  // Those that a marker may be a part of, the smallest first.
  std::vector<const Blob*> patches;
  for (const Blob& blob : found.blobs) {
    const bool round = IsRound(blob);
    if (round) Keep(image, blob, is_cut(blob));
    // Of a large round one too: a sphere in front of a warm lampshade.
    if (!round || blob.area_px >= kLargeAreaPx) patches.push_back(&blob);
  }
  const auto box_px = [](const Blob& blob) { return int64_t{blob.box.width} * blob.box.height; };
  std::stable_sort(patches.begin(), patches.end(),
                   [&](const Blob* a, const Blob* b) { return box_px(*a) < box_px(*b); });
  for (const Blob* const blob : patches) {
    // A sphere in front of a window or a lamp has merged with its white.
    if (masked_px_left_ < box_px(*blob)) {
      ++dismissed_;
      continue;
    }
    masked_px_left_ -= box_px(*blob);
    if (kLevels[level_].white) {
      for (const Blob& coloured : levels_[level_].coloured.Find(image, blob->box).blobs) {
        if (coloured.area_px < blob->area_px && IsRound(coloured)) {
          Keep(image, coloured, is_cut(*blob));
        }
      }
    }
    if (split_px_left_ < box_px(*blob)) {
      ++dismissed_;
      continue;
    }
    split_px_left_ -= box_px(*blob);
    for (const Blob& disc : discs_.Find(image, finder, *blob, options_.min_area_px)) {
      Keep(image, disc, is_cut(*blob));
    }
    for (const Blob& piece : splitter_.Split(image, *blob, options_.min_area_px)) {
      Keep(image, piece, is_cut(*blob));
    }
  }
  all_spots_ = spots_.size() <= kMaxSpots;
  if (all_spots_) return;
  cut_short_ = true;
  std::stable_sort(spots_.begin(), spots_.end(), [](const Spot& a, const Spot& b) {
    const bool round_a = IsRound(a.blob), round_b = IsRound(b.blob);
    return round_a != round_b ? round_a : a.core.squaredNorm() > b.core.squaredNorm();
  });
  spots_.resize(kMaxSpots);
}

// How unlike the middles of a candidate's markers are, as a chi-squared.
double WandDetector::Unlikeness(const WandCandidate& candidate) const {
  float mean = 0;
  Eigen::Vector3f colour = Eigen::Vector3f::Zero();
  const auto count = static_cast<float>(candidate.blobs.size());
  const auto core_of = [this](int blob) { return spots_[static_cast<size_t>(blob)].core; };
  for (const int blob : candidate.blobs) {
    const float brightness = core_of(blob).norm();
    mean += std::log(brightness) / count;
    colour += core_of(blob) / brightness;
  }
  colour.normalize();
  double cost = 0;
  for (const int blob : candidate.blobs) {
    const float brightness = core_of(blob).norm();
    const float away = (std::log(brightness) - mean) / kBrightnessSigma;
    cost += static_cast<double>(away * away + (core_of(blob) / brightness - colour).squaredNorm() /
                                                  (kColourSigma * kColourSigma));
  }
  return cost;
}

Verdict WandDetector::Search(const ImageView& image, const PixelRect& part, size_t level) {
  window_ = part;
  level_ = level;
  FindSpots(image, part);
  standing_out_.clear();
  cores_.clear();
  for (const Spot& spot : spots_) {
    standing_out_.push_back(spot.blob);
    cores_.push_back(spot.core);
  }
  wand_finder_.LimitFits(std::min(fits_left_, kFitsOfLevel));
  const std::vector<WandCandidate>& found = wand_finder_.Find(standing_out_, {}, cores_);
  fits_left_ -= wand_finder_.fits();
  cut_short_ |= wand_finder_.cut_short() || result().cut_short;
  // The most likely are measured first.
  std::vector<std::pair<double, size_t>> order;
  for (size_t i = 0; i < found.size(); ++i) {
    double cost = found[i].fit.cost + Unlikeness(found[i]);
    for (const int blob : found[i].blobs) cost += spots_[static_cast<size_t>(blob)].doubt;
    order.emplace_back(cost, i);
  }
  std::sort(order.begin(), order.end());
  candidates_.clear();
  for (size_t i = 0; i < std::min(order.size(), kMaxMeasured); ++i) {
    candidates_.push_back(found[order[i].second]);
    candidates_.back().cost = order[i].first;
  }
  double work = std::min(work_left_, kWorkOfLevel);
  work_left_ -= work;
  Verdict verdict = verifier_.Verify(image, standing_out_, wand_finder_, candidates_,
                                     kMaxFits - fits_left_, &work);
  work_left_ += work;
  has_rivals_ = verdict.ambiguous;
  const bool all = verdict.measured == order.size();
  cut_short_ |= !all;
  if (!verdict.wand && !verdict.ambiguous && part == image.Bounds()) return SearchPartial(image);
  if (!verdict.wand || (all && !wand_finder_.cut_short())) return verdict;
  // What was left out may be as good.
  const auto chosen = std::find_if(candidates_.begin(), candidates_.end(), [&](const auto& one) {
    return one.blobs == verdict.wand->blobs;
  });
  const double its_cost = order[static_cast<size_t>(chosen - candidates_.begin())].first;
  const bool sure = verdict.wand->cost < kSureCost && all_spots_;
  const double worse = sure ? kALittleWorse : WandVerifier::kClearlyWorse;
  verdict.ambiguous = (wand_finder_.cut_short() && !sure) ||
                      (!all && order[verdict.measured].first < its_cost + worse);
  if (verdict.ambiguous) verdict.wand.reset();
  return verdict;
}

// A wand of which one marker is mostly hidden.
Verdict WandDetector::SearchPartial(const ImageView& image) {
  // The rounder things first: whole markers.
  standing_out_.clear();
  for (const Spot& spot : spots_) {
    if (IsRound(spot.blob) && !spot.blob.touches_border) standing_out_.push_back(spot.blob);
  }
  const size_t whole = standing_out_.size();
  for (const Spot& spot : spots_) {
    if (!IsRound(spot.blob) || spot.blob.touches_border) standing_out_.push_back(spot.blob);
  }
  for (const Blob& blob : result().blobs) {
    if (!IsRound(blob)) standing_out_.push_back(blob);
  }
  // Two things and a part of a third are found by chance among many.
  if (whole < 2 || standing_out_.size() > kMaxWithHidden) return Verdict();
  candidates_ = FindPartialWands(wand_finder_, standing_out_, whole, kMaxPartial);
  double work = std::min(work_left_, kWorkOfLevel);
  work_left_ -= work;
  Verdict verdict = verifier_.Verify(image, standing_out_, wand_finder_, candidates_,
                                     kMaxFits - fits_left_, &work);
  work_left_ += work;
  if (verdict.measured < candidates_.size()) verdict.wand.reset();
  if (verdict.wand && (verdict.wand->confidence < kPartialConfidence ||
                       verdict.wand->label_confidence < kPartialConfidence)) {
    verdict.wand.reset();
  }
  return verdict;
}

std::optional<VerifiedWand> WandDetector::SearchTracked(const ImageView& image, int64_t time_ns,
                                                        uint32_t clock_epoch) {
  const auto part = track_.Window(time_ns, clock_epoch, image.Bounds());
  if (!part.has_value()) return std::nullopt;
  const Verdict verdict = Search(image, *part, level_);
  if (!verdict.wand.has_value() || verdict.wand->OccludedCount() > 0) return std::nullopt;
  for (const int blob : verdict.wand->blobs) {
    if (spots_[static_cast<size_t>(blob)].is_cut) return std::nullopt;
  }
  return verdict.wand;
}

MarkerObservation WandDetector::Observe(const VerifiedWand& wand, size_t k) const {
  MarkerObservation marker;
  marker.label_confidence = static_cast<float>(wand.label_confidence);
  if (!wand.whole[k]) return marker;
  const MarkerCentre& centre = wand.centres[k];
  marker.visible = true;
  marker.centre_px = centre.centre_px;
  marker.covariance_px2 =
      centre.covariance_px2 + kModelSigmaPx * kModelSigmaPx * Eigen::Matrix2d::Identity();
  if (const auto velocity = track_.Velocity(k); velocity.has_value()) {
    const Eigen::Vector2d spread_px = light_sigma_s_ * *velocity;
    marker.covariance_px2 += spread_px * spread_px.transpose();
  }
  wand_finder_.ToSphereCentre(wand.fit, k, &marker);
  return marker;
}

void WandDetector::Follow(const VerifiedWand& wand, Detection* detection) {
  Observation& observation = detection->observation;
  detection->confidence = wand.confidence;
  detection->occluded_markers = wand.OccludedCount();
  WandTrack::Points centres;
  double radius_px = 0;
  for (const MarkerCentre& centre : wand.centres) {
    centres.push_back(centre.centre_px);
    radius_px = std::max(radius_px, centre.radius_px);
  }
  track_.Add(observation.time_ns, observation.clock_epoch, centres, radius_px);
  for (size_t k = 0; k < wand.blobs.size(); ++k) observation.markers[k] = Observe(wand, k);
}

DetectionOutcome WandDetector::WhyNone(const ImageView& image, const Verdict& verdict) const {
  const ImageExposure exposure = LookAtExposure(image);
  if (exposure == ImageExposure::kSaturated) return DetectionOutcome::kSaturated;
  if (verdict.ambiguous) return DetectionOutcome::kAmbiguous;
  if (result().over_limit > 0 || cut_short_) return DetectionOutcome::kTooManyBlobs;
  if (!result().blobs.empty()) return DetectionOutcome::kNoWand;
  return exposure == ImageExposure::kBlack ? DetectionOutcome::kBlack : DetectionOutcome::kNoBlob;
}

absl::StatusOr<WandDetector> WandDetector::Create(const WandDetectorOptions& options,
                                                  const Target& target,
                                                  const CameraDescription& camera) {
  absl::Status status = options.Validate();
  status.Update(CheckTargetAndCamera(target, camera));
  if (!status.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("camera ", camera.camera, ": ", std::string(status.message())));
  }
  WandDetector detector(options, target, camera);
  for (const LevelRange& level : kLevels) {
    BlobFinderOptions its = options;
    its.max_runs = std::min(its.max_runs, kMaxRuns);
    its.colour.value_min += static_cast<int>(level.brighter * (255 - its.colour.value_min));
    its.colour.saturation_min *= level.paler;
    if (!level.white) its.colour.washed_out_min = kNeverWashedOut;
    RIGCAL_ASSIGN_OR_RETURN(BlobFinder blobs, BlobFinder::Create(its));
    RIGCAL_ASSIGN_OR_RETURN(ColourMasker masker, ColourMasker::Create(its.colour));
    its.colour.washed_out_min = kNeverWashedOut;
    RIGCAL_ASSIGN_OR_RETURN(BlobFinder coloured, BlobFinder::Create(its));
    detector.levels_.push_back({std::move(blobs), std::move(coloured), masker});
  }
  return detector;
}

absl::StatusOr<Detection> WandDetector::Detect(const ImageView& image, int64_t time_ns,
                                               uint32_t clock_epoch) {
  const ImageSize size = camera_.image_size_px;
  if (image.data == nullptr || image.width != static_cast<int>(size.width) ||
      image.height != static_cast<int>(size.height)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "camera ", camera_.camera, ": an image of ", image.width, "x", image.height, " pixels",
        image.data == nullptr ? " without data" : "", ", its description says ", size.width, "x",
        size.height, "; set the camera's region or its calibration right"));
  }
  Detection detection;
  detection.observation.time_ns = time_ns;
  detection.observation.clock_epoch = clock_epoch;
  detection.observation.markers.resize(static_cast<size_t>(target_.marker_count()));

  cut_short_ = false;
  dismissed_ = 0;
  passed_share_ = white_share_ = 0;
  masked_px_left_ = kMaxMaskedPx;
  split_px_left_ = kMaxSplitPx;
  runs_ = 0;
  fits_left_ = kMaxFits;
  work_left_ = kMaxWork;
  std::optional<VerifiedWand> wand;
  if (options_.tracking) wand = SearchTracked(image, time_ns, clock_epoch);
  detection.tracked = wand.has_value();
  detection.outcome = DetectionOutcome::kWand;
  if (!wand.has_value()) {
    const Verdict verdict = SearchAll(image);
    wand = verdict.wand;
    if (!wand.has_value()) detection.outcome = WhyNone(image, verdict);
  }
  detection.cut_short = cut_short_;
  detection.passed_share = passed_share_;
  detection.white_share = white_share_;
  detection.dismissed_patches = dismissed_;
  detection.blob_count = static_cast<int>(result().blobs.size());
  if (wand.has_value()) {
    Follow(*wand, &detection);
  } else {
    track_.Forget();
  }
  return detection;
}

}  // namespace rigcal::agent
