// SPDX-License-Identifier: Apache-2.0
// The whole way from encoded events to the wand: what it answers must be in order, finite, inside
// the image, and counted, whatever comes in; and where time goes on as in a sensor, the cuts
// between pieces must change nothing.
//
// Input: settings, one byte each (Settings); then, by a bit of the first, words of the format, or
// steps of a few bytes that are written as EVT 3.0 (Scene): discs that blink, gaps, triggers.
#include "agent/detect/event/blink_wand_detector.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <span>
#include <utility>
#include <vector>

#include "agent/event/evt3_writer.h"
#include "tests/fuzz/fuzz_check.h"
#include "tests/fuzz/fuzz_input.h"

namespace rigcal::agent {
namespace {

using testing::FuzzInput;

struct Settings {
  EventFormat format = EventFormat::kEvt3;
  bool halves_swapped = false;
  bool scene = false;
  bool own_pieces = false;
  BlinkWandDetectorOptions options;
  CameraDescription camera;
  Target target;
};

Target TargetOf(uint32_t kind) {
  static const char* const texts[] = {"wand:0,0.13,0.39;diameter=0.04", "wand:0,0.13,0.39",
                                      "wand:0,0.3", "point", "wand:0,0.1,0.25,0.45,0.5"};
  return *ParseTarget(texts[kind % std::size(texts)]);
}

Settings TakeSettings(FuzzInput* input) {
  Settings settings;
  const uint32_t kind = input->Byte();
  settings.scene = (kind & 1) != 0;
  settings.format = settings.scene ? EventFormat::kEvt3 : EventFormat(1 + (kind >> 1 & 3));
  settings.halves_swapped = (kind & 8) != 0;
  settings.own_pieces = (kind & 16) != 0;
  settings.target = TargetOf(kind >> 5);
  static constexpr double kBlinkHz[] = {500, 20, 5000, 137};
  static constexpr double kRateHz[] = {200, 1000, 10, 0};
  const uint32_t times = input->Byte();
  settings.options.blink_hz = kBlinkHz[times & 3];
  settings.options.output.rate_hz = kRateHz[times >> 2 & 3];
  settings.options.output.trigger = TriggerInstant(times >> 4 & 3);
  if (settings.options.output.rate_hz == 0 &&
      settings.options.output.trigger == TriggerInstant::kNone) {
    settings.options.output.trigger = TriggerInstant::kRising;
  }
  settings.options.output.trigger_channel = (times & 64) != 0 ? 1 : -1;
  const uint32_t filter = input->Byte();
  settings.options.min_periods = static_cast<int>(1 + filter % 7);
  settings.options.min_blob_pixels = (filter & 8) != 0 ? 1 : 8;
  settings.options.band_rel = (filter & 64) != 0 ? 0.45 : 0.15;
  settings.camera.camera = "camera";
  settings.camera.image_size_px = {1 + input->Byte() % 200u, 1 + input->Byte() % 200u};
  if ((filter & 128) != 0) {
    Intrinsics intrinsics;
    intrinsics.fx_px = intrinsics.fy_px = 150;
    intrinsics.cx_px = 0.5 * settings.camera.image_size_px.width;
    intrinsics.cy_px = 0.5 * settings.camera.image_size_px.height;
    settings.camera.intrinsics = intrinsics;
  }
  return settings;
}

// A scene in steps; its time goes forward by less than what is taken for a gap.
class Scene {
 public:
  explicit Scene(const Settings& settings)
      : size_(settings.camera.image_size_px), period_us_(1e6 / settings.options.blink_hz) {}

  std::vector<uint8_t> Write(FuzzInput* input) {
    constexpr int kMaxSteps = 200;
    constexpr size_t kMaxBytes = 1 << 16;
    constexpr int64_t kMaxUs = 1'500'000;
    for (int i = 0; i < kMaxSteps && !input->empty(); ++i) {
      if (bytes_.size() >= kMaxBytes || time_us_ >= kMaxUs) break;
      Step(input);
    }
    return std::move(bytes_);
  }

 private:
  struct Disc {
    int x, y, radius;
  };

  void Step(FuzzInput* input) {
    const uint32_t what = input->Byte();
    switch (what & 3) {
      case 0:
        discs_.push_back({input->Byte(), input->Byte(), 1 + input->Byte() % 20});
        if (discs_.size() > 6) discs_.erase(discs_.begin());
        break;
      case 1:
        for (uint32_t n = 0; n <= (what >> 2) % 8; ++n) Blink(input->Byte() % 16);
        break;
      case 2:
        time_us_ += input->Word16();
        writer_.Write(TriggerEvent{.time_us = time_us_,
                                   .channel = static_cast<uint8_t>(what >> 2 & 1),
                                   .rising = (what & 8) != 0},
                      &bytes_);
        break;
      case 3:
        if ((what & 4) != 0) discs_.clear();
        time_us_ += what >> 3;
        break;
    }
  }

  // One period; every disc moves by up to 7 pixels first.
  void Blink(uint32_t motion) {
    for (Disc& disc : discs_) disc.x += static_cast<int>(motion) - 8;
    for (const bool on : {true, false}) {
      events_.clear();
      for (const Disc& disc : discs_) Fill(disc, on);
      // At least some noise: after a second of silence nothing is searched.
      if (events_.empty()) events_.push_back({.time_us = time_us_, .x = 0, .y = 0, .on = false});
      writer_.Write(events_, &bytes_);
      time_us_ += static_cast<int64_t>(period_us_ / 2);
    }
  }

  void Fill(const Disc& disc, bool on) {
    for (int y = std::max(0, disc.y - disc.radius);
         y < std::min(static_cast<int>(size_.height), disc.y + disc.radius + 1); ++y) {
      for (int x = std::max(0, disc.x - disc.radius);
           x < std::min(static_cast<int>(size_.width), disc.x + disc.radius + 1); ++x) {
        const int dx = x - disc.x, dy = y - disc.y;
        if (dx * dx + dy * dy > disc.radius * disc.radius) continue;
        events_.push_back({.time_us = time_us_,
                           .x = static_cast<uint16_t>(x),
                           .y = static_cast<uint16_t>(y),
                           .on = on});
      }
    }
  }

  ImageSize size_;
  double period_us_;
  int64_t time_us_ = 1000;
  Evt3Writer writer_;
  std::vector<Disc> discs_;
  std::vector<CdEvent> events_;
  std::vector<uint8_t> bytes_;
};

void CheckMarker(const MarkerObservation& marker, const Settings& settings) {
  if (!marker.visible) return;
  const auto size = settings.camera.image_size_px;
  // The projection of a sphere's centre is near its image.
  const double slack_px = 20;
  FUZZ_CHECK(marker.centre_px.x() > -slack_px && marker.centre_px.x() < size.width + slack_px);
  FUZZ_CHECK(marker.centre_px.y() > -slack_px && marker.centre_px.y() < size.height + slack_px);
  FUZZ_CHECK(marker.covariance_px2.allFinite() && marker.covariance_px2.determinant() > 0);
  FUZZ_CHECK(marker.label_confidence >= 0 && marker.label_confidence <= 1);
  const double period_ns = 1e9 / settings.options.blink_hz;
  FUZZ_CHECK(std::abs(static_cast<double>(marker.time_delta_ns)) < 10 * period_ns);
}

void CheckFound(const std::vector<Detection>& found, const BlinkWandDetector& detector,
                const Settings& settings) {
  DetectionCounts counts;
  for (size_t i = 0; i < found.size(); ++i) {
    const Detection& detection = found[i];
    const Observation& now = detection.observation;
    counts.Add(detection.outcome);
    FUZZ_CHECK(now.markers.size() == static_cast<size_t>(settings.target.marker_count()));
    FUZZ_CHECK(detection.outcome == DetectionOutcome::kWand || now.VisibleCount() == 0);
    FUZZ_CHECK(detection.confidence >= 0 && detection.confidence <= 1);
    for (const MarkerObservation& marker : now.markers) CheckMarker(marker, settings);
    if (i == 0) continue;
    const Observation& before = found[i - 1].observation;
    FUZZ_CHECK(now.clock_epoch >= before.clock_epoch);
    FUZZ_CHECK(now.clock_epoch > before.clock_epoch || now.time_ns > before.time_ns);
  }
  FUZZ_CHECK(counts == detector.counts().by_outcome);
}

struct Detected {
  std::vector<Detection> found;
  BlinkWandCounts counts;
};

Detected Detect(const Settings& settings, std::span<const uint8_t> bytes, size_t piece_bytes) {
  auto detector = BlinkWandDetector::Create(settings.options, settings.target, settings.camera,
                                            settings.format, settings.halves_swapped);
  FUZZ_CHECK(detector.ok());
  std::vector<Detection> found;
  while (!bytes.empty()) {
    const size_t size = std::min(piece_bytes, bytes.size());
    // A copy of exactly this size: the sanitizer sees reads past its end.
    const std::vector<uint8_t> piece(bytes.begin(),
                                     bytes.begin() + static_cast<std::ptrdiff_t>(size));
    detector->Take(piece, &found);
    bytes = bytes.subspan(size);
  }
  detector->Finish(&found);
  CheckFound(found, *detector, settings);
  return {.found = std::move(found), .counts = detector->counts()};
}

bool Same(const Detection& a, const Detection& b) {
  if (a.outcome != b.outcome || a.observation.time_ns != b.observation.time_ns) return false;
  for (size_t k = 0; k < a.observation.markers.size(); ++k) {
    const MarkerObservation &m = a.observation.markers[k], &n = b.observation.markers[k];
    if (m.visible != n.visible || m.centre_px != n.centre_px ||
        m.time_delta_ns != n.time_delta_ns) {
      return false;
    }
  }
  return true;
}

}  // namespace
}  // namespace rigcal::agent

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace rigcal::agent;  // NOLINT
  FuzzInput input(data, size);
  const Settings settings = TakeSettings(&input);
  const size_t word = rigcal::agent::WordBytes(settings.format);
  const size_t piece = word * (1 + input.Byte() % 64u * 3);
  if (!settings.scene) {
    constexpr size_t kMaxBytes = 2048;
    Detect(settings, input.rest().first(std::min(input.rest().size(), kMaxBytes)),
           settings.own_pieces ? piece : kMaxBytes);
    return 0;
  }
  const std::vector<uint8_t> bytes = Scene(settings).Write(&input);
  const Detected whole = Detect(settings, bytes, bytes.size() + 1);
  const Detected cut = Detect(settings, bytes, piece);
  // Counts of pieces with too little data depend on the pieces.
  if (whole.counts.beyond_data != 0 || cut.counts.beyond_data != 0) return 0;
  FUZZ_CHECK(whole.found.size() == cut.found.size());
  FUZZ_CHECK(std::equal(whole.found.begin(), whole.found.end(), cut.found.begin(), Same));
  return 0;
}
