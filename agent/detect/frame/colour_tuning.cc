// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/colour_tuning.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "absl/strings/str_cat.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr int kSectors = 8;  // of the hues; a range takes two of them
// Least brightness, grey levels. In rooms of the wand's colour the detector tries more by itself.
constexpr int kValue = 60;
constexpr double kGoodEnough = 0.9;  // confidence for which only the last wand's range is searched
constexpr double kMuchWhite = 0.02;  // share of the picture
constexpr double kLooseSaturation = 0.2;  // saturation_min of the ranges
constexpr int kCoreRadiusPx = 2;      // pixels this near to a marker's centre are surely its own
constexpr int kLeastWands = 3;        // frames with the wand
constexpr double kOutside = 0.01;     // share of the pixels outside of a range, on each side
constexpr double kHueMarginDeg = 12;  // added on each side
constexpr double kLargestHueRangeDeg = 100;  // a larger range is no colour
// Limits over the dimmest and palest pixels in a marker's middle, as its edge is half as bright.
constexpr double kValueShare = 0.45, kSaturationShare = 0.6;

struct Colour {
  double hue_deg, saturation, value;
};

Colour ColourOf(double b, double g, double r) {
  const double high = std::max({b, g, r}), chroma = high - std::min({b, g, r});
  double hue = 0;
  if (chroma > 0) {
    if (high == r) {
      hue = (g - b) / chroma;
    } else if (high == g) {
      hue = 2 + (b - r) / chroma;
    } else {
      hue = 4 + (r - g) / chroma;
    }
  }
  return {std::fmod(60 * hue + 360, 360), high > 0 ? chroma / high : 0, high};
}

// Rotates the histogram so that its widest gap lies at the ends; `turn` is the hue of index 0.
std::array<int64_t, 360> Unrolled(const std::array<int64_t, 360>& hues, int* turn) {
  int best = -1, run = 0;
  *turn = 0;
  for (int i = 0; i < 720; ++i) {
    run = hues[static_cast<size_t>(i % 360)] == 0 ? run + 1 : 0;
    if (run <= best || run > 360) continue;
    best = run;
    *turn = (i + 1) % 360;
  }
  std::array<int64_t, 360> result{};
  for (int i = 0; i < 360; ++i) {
    result[static_cast<size_t>(i)] = hues[static_cast<size_t>((i + *turn) % 360)];
  }
  return result;
}

}  // namespace

absl::StatusOr<ColourTuner> ColourTuner::Create(const Target& target,
                                                const CameraDescription& camera) {
  if (target.marker_count() < 3) {
    return absl::InvalidArgumentError(
        absl::StrCat("camera ", camera.camera, ": a colour is learnt from a wand of at least ",
                     "three markers, this target has ", target.marker_count(),
                     "; set the colour range by hand"));
  }
  std::vector<WandDetector> detectors;
  for (int sector = 0; sector < kSectors; ++sector) {
    WandDetectorOptions options;
    options.tracking = false;
    options.colour.value_min = kValue;
    options.colour.saturation_min = kLooseSaturation;
    options.colour.hue_min_deg = sector * 360.0 / kSectors;
    options.colour.hue_max_deg = std::fmod((sector + 2) * 360.0 / kSectors, 360);
    RIGCAL_ASSIGN_OR_RETURN(WandDetector detector, WandDetector::Create(options, target, camera));
    detectors.push_back(std::move(detector));
  }
  return ColourTuner(std::move(detectors));
}

absl::Status ColourTuner::Add(const ImageView& image) {
  std::optional<Detection> best;
  grey_ = image.format == PixelFormat::kMono8;
  bool saturated = false, black = true, ambiguous = false;
  double white = 0;
  const size_t count = grey_ ? 1 : detectors_.size();  // grey images have no hue
  for (size_t i = 0, first = std::min(last_, count - 1); i < count; ++i) {
    const size_t sector = (first + i) % count;
    RIGCAL_ASSIGN_OR_RETURN(Detection detection, detectors_[sector].Detect(image, frames_, 0));
    saturated |= detection.outcome == DetectionOutcome::kSaturated;
    black &= detection.outcome == DetectionOutcome::kBlack;
    ambiguous |= detection.outcome == DetectionOutcome::kAmbiguous;
    white = std::max(white, detection.white_share);
    if (detection.outcome != DetectionOutcome::kWand || detection.occluded_markers > 0) continue;
    if (best.has_value() && best->confidence >= detection.confidence) continue;
    best = std::move(detection);
    last_ = sector;
    if (i == 0 && wands_ > 0 && best->confidence > kGoodEnough) break;
  }
  ++frames_;
  if (!best.has_value()) {
    saturated_ += saturated ? 1 : 0;
    black_ += black ? 1 : 0;
    ambiguous_ += ambiguous ? 1 : 0;
    white_ += white > kMuchWhite ? 1 : 0;
    return absl::OkStatus();
  }
  ++wands_;
  Count(image, best->observation);
  return absl::OkStatus();
}

void ColourTuner::Count(const ImageView& image, const Observation& observation) {
  for (const MarkerObservation& marker : observation.markers) {
    const int x0 = static_cast<int>(std::lround(marker.centre_px.x()));
    const int y0 = static_cast<int>(std::lround(marker.centre_px.y()));
    for (int y = std::max(0, y0 - kCoreRadiusPx);
         y <= std::min(image.height - 1, y0 + kCoreRadiusPx); ++y) {
      for (int x = std::max(0, x0 - kCoreRadiusPx);
           x <= std::min(image.width - 1, x0 + kCoreRadiusPx); ++x) {
        if ((x - x0) * (x - x0) + (y - y0) * (y - y0) > kCoreRadiusPx * kCoreRadiusPx) continue;
        const uint8_t* pixel = image.Row(y) + x * BytesPerPixel(image.format);
        const Colour colour = grey_ ? Colour{0, 0, static_cast<double>(pixel[0])}
                                    : ColourOf(pixel[0], pixel[1], pixel[2]);
        ++values_[static_cast<size_t>(colour.value)];
        ++hues_[static_cast<size_t>(colour.hue_deg) % hues_.size()];
        ++saturations_[static_cast<size_t>(100 * colour.saturation)];
      }
    }
  }
}

// Says what most of the frames without a wand have in common, and what helps against it.
std::string ColourTuner::WhyNone() const {
  const int missed = frames_ - wands_;
  const auto most = [missed](int some) { return 2 * some > missed; };
  if (missed == 0) return "";
  if (most(saturated_)) {
    return absl::StrCat("; ", saturated_,
                        " of them are white for the most part: shorten the exposure or turn the "
                        "gain down");
  }
  if (most(black_)) {
    return absl::StrCat("; ", black_,
                        " of them are black: switch the wand on, lengthen the exposure or turn "
                        "the gain up");
  }
  if (most(ambiguous_)) {
    return absl::StrCat("; in ", ambiguous_,
                        " of them several things look like it: learn a mask without the wand "
                        "first (rigcal-agent mask), or cover them");
  }
  if (most(white_)) {
    return absl::StrCat("; in ", white_,
                        " of them windows or lamps are white: shorten the exposure, dim the room "
                        "or learn a mask without the wand first (rigcal-agent mask)");
  }
  return "; nothing of its shape stands out: dim the room, come nearer, or take LEDs of a colour "
         "that the room has not";
}

absl::StatusOr<TunedColour> ColourTuner::Result() const {
  constexpr char kAdvice[] =
      "; show all of it, 1.5 to 4 m away and moving slowly, without lamps of its colour beside it, "
      "shorten the exposure or lower the gain if it is white in the frame, and tune again";
  if (wands_ < kLeastWands || 3 * wands_ < frames_) {
    return absl::FailedPreconditionError(
        absl::StrCat("nothing like the wand in ", frames_ - wands_, " of ", frames_,
                     " frames, it must be in at least ", std::max(kLeastWands, (frames_ + 2) / 3),
                     WhyNone(), kAdvice));
  }
  TunedColour tuned;
  tuned.frames = frames_;
  tuned.wands = wands_;
  tuned.value = HistogramQuantile(values_, 0.5);
  tuned.colour.value_min =
      std::clamp(static_cast<int>(kValueShare * HistogramQuantile(values_, kOutside)), 1, 255);
  if (grey_) return tuned;
  int turn = 0;
  const auto hues = Unrolled(hues_, &turn);
  const double low = HistogramQuantile(hues, kOutside),
               high = HistogramQuantile(hues, 1 - kOutside);
  if (high - low > kLargestHueRangeDeg) {
    return absl::FailedPreconditionError(
        absl::StrCat("what looks like the wand has hues from ", std::fmod(low + turn, 360), " to ",
                     std::fmod(high + turn, 360), " degrees, no colour of its own", kAdvice));
  }
  tuned.hue_deg = std::fmod(HistogramQuantile(hues, 0.5) + turn, 360);
  tuned.saturation = 0.01 * HistogramQuantile(saturations_, 0.5);
  tuned.colour.hue_min_deg = std::fmod(low + turn - kHueMarginDeg + 360, 360);
  tuned.colour.hue_max_deg = std::fmod(high + turn + 1 + kHueMarginDeg, 360);
  tuned.colour.saturation_min = kSaturationShare * 0.01 * HistogramQuantile(saturations_, kOutside);
  return tuned;
}

}  // namespace rigcal::agent
