// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/event_spheres.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/camera/camera_model.h"
#include "common/simulation/frames/light_model.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

// Nearer than that two switches are one.
constexpr double kShortestStepUs = 1e-3;
// Around a sphere: where pixels may still settle after it has passed.
constexpr int kSettlePx = 2;
// Noise of a sphere's pixels is drawn for each part, so at least this many.
constexpr int kLeastParts = 2;
// A sphere's way in one part, where possible.
constexpr double kSpherePartPx = 0.35;

bool Overlap(const ImagePatch& a, const ImagePatch& b) {
  return !a.empty() && !b.empty() && a.x < b.x + b.width && b.x < a.x + a.width &&
         a.y < b.y + b.height && b.y < a.y + a.height;
}

float CoverAt(const SphereImage& image, int x, int y) {
  const bool covered = image.patch.HasRow(y) && image.patch.HasColumn(x);
  return covered ? image.cover[image.patch.IndexOf(x, y)] : 0;
}

ImagePatch Around(std::span<const SphereImage> images, const ImageSize& size) {
  int left = static_cast<int>(size.width), right = 0;
  int top = static_cast<int>(size.height), bottom = 0;
  for (const SphereImage& image : images) {
    const ImagePatch& patch = image.patch;
    if (patch.empty()) continue;
    left = std::min(left, patch.x - kSettlePx);
    right = std::max(right, patch.x + patch.width + kSettlePx);
    top = std::min(top, patch.y - kSettlePx);
    bottom = std::max(bottom, patch.y + patch.height + kSettlePx);
  }
  ImagePatch around;
  around.x = std::max(0, left);
  around.y = std::max(0, top);
  around.width = std::min(static_cast<int>(size.width), right) - around.x;
  around.height = std::min(static_cast<int>(size.height), bottom) - around.y;
  return around;
}

}  // namespace

bool BlinkingLed::IsLit(double time_s) const {
  if (hz <= 0) return true;
  const double turns = hz * time_s + phase, cycle = std::floor(turns);
  const auto [rise, fall] = TurnsOf(cycle);
  return turns >= cycle + rise && turns < cycle + fall;
}

std::pair<double, double> BlinkingLed::TurnsOf(double cycle) const {
  const double edge = code.EdgeAt(clock_rate * cycle / hz);
  return {edge, duty - edge};
}

void BlinkingLed::StepsOf(double begin_us, double duration_us,
                          std::vector<LightStep>* steps) const {
  steps->clear();
  double from_us = 0;
  const auto cut_at = [&](double cut_us) {
    if (cut_us - from_us < kShortestStepUs) return;
    steps->push_back({cut_us, IsLit(1e-6 * (begin_us + 0.5 * (from_us + cut_us)))});
    from_us = cut_us;
  };
  if (hz > 0) {
    const double period_us = 1e6 / hz;
    const double turns = 1e-6 * hz * begin_us + phase;
    for (double cycle = std::floor(turns);; ++cycle) {
      const double on_us = (cycle - turns) * period_us;
      if (on_us >= duration_us) break;
      const auto [rise, fall] = TurnsOf(cycle);
      for (const double cut : {on_us, on_us + rise * period_us, on_us + fall * period_us}) {
        if (cut < duration_us - kShortestStepUs) cut_at(cut);
      }
    }
  }
  cut_at(duration_us);
}

EventSpheres::EventSpheres(SphereImager imager, const EdgeProfile& profile, const Target& target,
                           const FrameRenderOptions& scene, double led_phase,
                           const EventLight& light)
    : imager_(std::move(imager)), profile_(profile), light_(light) {
  sphere_options_.radius_m = SphereRadiusM(target);
  sphere_options_.limb = scene.limb;
  for (size_t i = 0; i < target.marker_positions_m.size(); ++i) {
    Marker& marker = markers_.emplace_back();
    marker.position_m = target.marker_positions_m[i];
    marker.led = {.hz = BlinkHz(target, scene, i) * (1 + 1e-6 * scene.blink_drift_ppm),
                  .duty = scene.blink_duty,
                  .phase = led_phase,
                  .code = SentCodeOf(scene, target, i),
                  .clock_rate = 1 + 1e-6 * scene.blink_drift_ppm};
  }
}

std::vector<MarkerGroundTruth> EventSpheres::TruthOf(const WandPose& wand) const {
  std::vector<MarkerGroundTruth> truth;
  for (const Marker& marker : markers_) {
    truth.push_back(rigcal::TruthOf(imager_.intrinsics(), imager_.image_size(),
                                    wand.At(marker.position_m), sphere_options_.radius_m));
  }
  return truth;
}

int EventSpheres::PartsFor(int64_t begin_us, int64_t cell_us, const WandPath& path) const {
  const auto begin = path ? path(1e-6 * static_cast<double>(begin_us)) : std::nullopt;
  const auto end = path ? path(1e-6 * static_cast<double>(begin_us + cell_us)) : std::nullopt;
  if (!begin || !end) return kLeastParts;
  double way_px = 0;
  for (const Marker& marker : markers_) {
    Eigen::Vector2d from, to;
    if (!Project(imager_.intrinsics(), begin->At(marker.position_m), &from) ||
        !Project(imager_.intrinsics(), end->At(marker.position_m), &to)) {
      continue;
    }
    way_px = std::max(way_px, (to - from).norm());
  }
  int parts = kLeastParts;
  while (parts < kMaxParts && way_px > parts * kSpherePartPx) parts *= 2;
  return parts;
}

absl::Status EventSpheres::Draw(double time_s, const WandPath& path, int image) {
  const std::optional<WandPose> wand = path ? path(time_s) : std::nullopt;
  for (Marker& marker : markers_) {
    marker.images[image].patch = {};
    if (!wand.has_value()) continue;
    SphereMotion sphere;
    sphere.centre_m = wand->At(marker.position_m);
    if (!sphere.centre_m.allFinite()) {
      return absl::InvalidArgumentError(
          absl::StrCat("event renderer: the wand's pose at ", time_s, " s is not finite"));
    }
    const ExposurePart now{.dt_s = 0, .share = 1, .lit_share = 1};
    imager_.Draw(sphere, {&now, 1}, profile_, sphere_options_, &marker.images[image]);
  }
  return absl::OkStatus();
}

absl::Status EventSpheres::DrawCell(int64_t begin_us, int64_t cell_us, const WandPath& path) {
  begin_us_ = begin_us;
  cell_us_ = cell_us;
  // The last cell's end is this one's beginning.
  for (Marker& marker : markers_) std::swap(marker.images[0], marker.images[parts_]);
  parts_ = PartsFor(begin_us, cell_us, path);
  if (begin_us == 0) RIGCAL_RETURN_IF_ERROR(Draw(0, path, 0));
  for (int i = 1; i <= parts_; ++i) {
    const double time_s = 1e-6 * static_cast<double>(begin_us + i * cell_us / parts_);
    RIGCAL_RETURN_IF_ERROR(Draw(time_s, path, i));
  }
  for (Marker& marker : markers_) {
    marker.patch = Around(std::span(marker.images).first(static_cast<size_t>(parts_) + 1),
                          imager_.image_size());
    FindRows(&marker);
  }
  for (Marker& marker : markers_) {
    marker.alone = std::none_of(markers_.begin(), markers_.end(), [&marker](const Marker& other) {
      return &other != &marker && Overlap(other.patch, marker.patch);
    });
  }
  return absl::OkStatus();
}

void EventSpheres::FindRows(Marker* marker) const {
  const ImagePatch& around = marker->patch;
  marker->rows.clear();
  for (int y = around.y; y < around.y + around.height; ++y) {
    PixelSpan columns{static_cast<int>(imager_.image_size().width), 0};
    for (int i = 0; i <= parts_; ++i) {
      const SphereImage& image = marker->images[i];
      const ImagePatch& patch = image.patch;
      if (!patch.HasRow(y)) continue;
      const float* const cover = &image.cover[patch.IndexOf(patch.x, y)];
      int begin = 0, end = patch.width;
      while (begin < end && cover[begin] == 0) ++begin;
      while (end > begin && cover[end - 1] == 0) --end;
      if (begin == end) continue;
      columns.begin = std::min(columns.begin, patch.x + begin - kSettlePx);
      columns.end = std::max(columns.end, patch.x + end + kSettlePx);
    }
    columns.begin = std::max(columns.begin, around.x);
    columns.end = std::min(columns.end, around.x + around.width);
    marker->rows.push_back(columns);
  }
}

void EventSpheres::AddSpans(int y, std::vector<PixelSpan>* spans) const {
  for (const Marker& marker : markers_) {
    if (!marker.patch.HasRow(y)) continue;
    spans->push_back(marker.rows[static_cast<size_t>(y - marker.patch.y)]);
  }
}

void EventSpheres::Shine(const Marker& marker, const SphereImage& image,
                         const EventClutter& clutter, const EventClutter::Instant& instant,
                         std::vector<float>* dark, std::vector<float>* lit) {
  const ImagePatch& patch = marker.patch;
  const auto width = static_cast<size_t>(patch.width);
  const float shell = light_.shell + light_.dark;
  dark->resize(width * static_cast<size_t>(patch.height));
  lit->resize(dark->size());
  for (int row = 0; row < patch.height; ++row) {
    const int y = patch.y + row;
    float* const dark_row = dark->data() + static_cast<size_t>(row) * width;
    float* const lit_row = lit->data() + static_cast<size_t>(row) * width;
    clutter.LightOf(y, {patch.x, patch.x + patch.width}, instant, dark_row);
    std::copy(dark_row, dark_row + width, lit_row);
    if (image.patch.HasRow(y)) {
      const size_t first = image.patch.IndexOf(image.patch.x, y);
      const auto shift = static_cast<size_t>(image.patch.x - patch.x);
      for (size_t i = 0; i < static_cast<size_t>(image.patch.width); ++i) {
        const float cover = image.cover[first + i];
        float& one = dark_row[shift + i];
        one += cover * (shell - one);
        lit_row[shift + i] = one + light_.led * image.lit[first + i];
      }
    }
  }
  for (float& one : *dark) one = FastLog(one);
  for (float& one : *lit) one = FastLog(one);
}

// The one of several overlapping markers that covers most of a pixel.
const EventSpheres::Marker* EventSpheres::OwnerOf(int x, int y, int part) const {
  const Marker* owner = nullptr;
  float most = -1;
  for (const Marker& marker : markers_) {
    if (!marker.patch.HasRow(y)) continue;
    const PixelSpan columns = marker.rows[static_cast<size_t>(y - marker.patch.y)];
    if (x < columns.begin || x >= columns.end) continue;
    const float cover = CoverAt(marker.images[part], x, y) + CoverAt(marker.images[part + 1], x, y);
    if (cover > most) owner = &marker, most = cover;
  }
  return owner;
}

void EventSpheres::Follow(int part, const EventClutter& clutter, const EventClutter::Instant& begin,
                          const EventClutter::Instant& end, EventPixels* pixels,
                          std::vector<PixelRequest>* requests) {
  const double part_us = static_cast<double>(cell_us_) / parts_;
  const double begin_us = static_cast<double>(begin_us_) + part * part_us;
  for (Marker& marker : markers_) {
    const ImagePatch& patch = marker.patch;
    if (patch.empty()) continue;
    marker.led.StepsOf(begin_us, part_us, &marker.steps);
    if (part == 0) {
      Shine(marker, marker.images[0], clutter, begin, &marker.dark[0], &marker.lit[0]);
    } else {
      marker.dark[0].swap(marker.dark[1]);
      marker.lit[0].swap(marker.lit[1]);
    }
    Shine(marker, marker.images[part + 1], clutter, end, &marker.dark[1], &marker.lit[1]);
    FindOwned(part, marker);
    FollowOwned(marker, begin_us, pixels, requests);
  }
}

void EventSpheres::FindOwned(int part, const Marker& drawn) {
  owned_.clear();
  for (int y = drawn.patch.y; y < drawn.patch.y + drawn.patch.height; ++y) {
    const PixelSpan columns = drawn.rows[static_cast<size_t>(y - drawn.patch.y)];
    if (drawn.alone) {
      if (columns.begin < columns.end) owned_.push_back({y, columns});
      continue;
    }
    for (int x = columns.begin; x < columns.end; ++x) {
      if (OwnerOf(x, y, part) != &drawn) continue;
      if (!owned_.empty() && owned_.back().y == y && owned_.back().columns.end == x) {
        ++owned_.back().columns.end;
      } else {
        owned_.push_back({y, {x, x + 1}});
      }
    }
  }
}

void EventSpheres::FollowOwned(const Marker& marker, double begin_us, EventPixels* pixels,
                               std::vector<PixelRequest>* requests) {
  for (size_t k = 0; begin_us == 0 && k < owned_.size(); ++k) {
    const auto& [y, columns] = owned_[k];
    for (int x = columns.begin; x < columns.end; ++x) {
      pixels->Settle(static_cast<uint32_t>(x), static_cast<uint32_t>(y),
                     marker.dark[0][marker.patch.IndexOf(x, y)]);
    }
  }
  const double whole_us = marker.steps.back().end_us;
  double from_us = 0;
  for (const LightStep& step : marker.steps) {
    const std::vector<float>& before = step.lit ? marker.lit[0] : marker.dark[0];
    const std::vector<float>& after = step.lit ? marker.lit[1] : marker.dark[1];
    const auto begin = static_cast<float>(from_us / whole_us);
    const auto end = static_cast<float>(step.end_us / whole_us);
    from_.resize(before.size());
    to_.resize(before.size());
    for (size_t i = 0; i < before.size(); ++i) {
      from_[i] = before[i] + begin * (after[i] - before[i]);
      to_[i] = before[i] + end * (after[i] - before[i]);
    }
    for (const auto& [y, columns] : owned_) {
      const size_t first = marker.patch.IndexOf(columns.begin, y);
      pixels->Add(static_cast<uint32_t>(columns.begin), static_cast<uint32_t>(y),
                  std::span(from_).subspan(first, columns.size()),
                  std::span(to_).subspan(first, columns.size()));
    }
    pixels->FollowAdded(begin_us + from_us, step.end_us - from_us, requests);
    from_us = step.end_us;
  }
}

}  // namespace rigcal
