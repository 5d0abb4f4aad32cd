// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/event_spheres.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/simulation/fast_math.h"
#include "common/simulation/scene_truth.h"

namespace rigcal {
namespace {

constexpr double kDefaultDiameterM = 0.04;
// Around a sphere: where pixels may still settle after it has passed.
constexpr int kSettlePx = 2;
// Nearer than that two switches are one.
constexpr double kShortestStepUs = 1e-3;

bool HasRow(const ImagePatch& patch, int y) {
  return !patch.empty() && y >= patch.y && y < patch.y + patch.height;
}

bool Overlap(const ImagePatch& a, const ImagePatch& b) {
  return !a.empty() && !b.empty() && a.x < b.x + b.width && b.x < a.x + a.width &&
         a.y < b.y + b.height && b.y < a.y + a.height;
}

size_t IndexIn(const ImagePatch& patch, int x, int y) {
  return static_cast<size_t>(y - patch.y) * static_cast<size_t>(patch.width) +
         static_cast<size_t>(x - patch.x);
}

float CoverAt(const SphereImage& image, int x, int y) {
  const ImagePatch& patch = image.patch;
  if (!HasRow(patch, y) || x < patch.x || x >= patch.x + patch.width) return 0;
  return image.cover[IndexIn(patch, x, y)];
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

EventSpheres::EventSpheres(const Intrinsics* intrinsics, const ImageSize& size, const RayGrid* rays,
                           const EdgeProfile* profile, const Target& target,
                           const FrameRenderOptions& scene, double led_phase,
                           const EventLight& light)
    : intrinsics_(intrinsics),
      size_(size),
      profile_(profile),
      imager_(intrinsics, size, rays),
      duty_(scene.blink_duty),
      led_phase_(led_phase),
      light_(light) {
  sphere_options_.radius_m = 0.5 * (target.diameter_m > 0 ? target.diameter_m : kDefaultDiameterM);
  sphere_options_.limb = scene.limb;
  for (size_t i = 0; i < target.marker_positions_m.size(); ++i) {
    Marker marker;
    marker.position_m = target.marker_positions_m[i];
    marker.blink_hz = target.blink_hz.empty() ? scene.blink_hz
                                              : target.blink_hz[target.blink_hz.size() > 1 ? i : 0];
    marker.blink_hz *= 1 + 1e-6 * scene.blink_drift_ppm;
    markers_.push_back(std::move(marker));
  }
}

bool EventSpheres::IsLit(size_t marker, double time_s) const {
  return IsLit(markers_[marker], time_s);
}

bool EventSpheres::IsLit(const Marker& marker, double time_s) const {
  if (marker.blink_hz <= 0) return true;
  const double turns = marker.blink_hz * time_s + led_phase_;
  return turns - std::floor(turns) < duty_;
}

std::vector<MarkerTruth> EventSpheres::TruthOf(const WandMotion& wand) const {
  std::vector<SphereMotion> spheres;
  for (const Marker& marker : markers_) spheres.push_back(wand.Marker(marker.position_m));
  return rigcal::TruthOf(*intrinsics_, size_, spheres, sphere_options_.radius_m, nullptr);
}

absl::Status EventSpheres::DrawCell(int64_t begin_us, int64_t cell_us, const WandPath& path) {
  begin_us_ = begin_us;
  cell_us_ = cell_us;
  for (Marker& marker : markers_) std::swap(marker.images[0], marker.images[kDraws]);
  for (int i = begin_us == 0 ? 0 : 1; i <= kDraws; ++i) {
    const double time_s = 1e-6 * static_cast<double>(begin_us + i * cell_us / kDraws);
    const std::optional<WandMotion> wand = path ? path(time_s) : std::nullopt;
    for (Marker& marker : markers_) {
      marker.images[i].patch = {};
      if (!wand.has_value()) continue;
      SphereMotion sphere;
      sphere.centre_m = wand->Marker(marker.position_m).centre_m;
      if (!sphere.centre_m.allFinite()) {
        return absl::InvalidArgumentError(
            absl::StrCat("event renderer: the wand's pose at ", time_s, " s is not finite"));
      }
      const ExposurePart now{.dt_s = 0, .share = 1, .lit_share = 1};
      imager_.Draw(sphere, {&now, 1}, *profile_, sphere_options_, &marker.images[i]);
    }
  }
  for (Marker& marker : markers_) {
    marker.patch = Around(marker.images, size_);
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
    PixelSpan columns{static_cast<int>(size_.width), 0};
    for (const SphereImage& image : marker->images) {
      const ImagePatch& patch = image.patch;
      if (!HasRow(patch, y)) continue;
      const float* const cover = &image.cover[IndexIn(patch, patch.x, y)];
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
    if (!HasRow(marker.patch, y)) continue;
    spans->push_back(marker.rows[static_cast<size_t>(y - marker.patch.y)]);
  }
}

// One step from switch to switch of the LED.
void EventSpheres::PlanSteps(double begin_us, double duration_us, Marker* marker) const {
  marker->steps.clear();
  double from_us = 0;
  const auto cut_at = [&](double cut_us) {
    if (cut_us - from_us < kShortestStepUs) return;
    marker->steps.push_back({cut_us, IsLit(*marker, 1e-6 * (begin_us + 0.5 * (from_us + cut_us)))});
    from_us = cut_us;
  };
  if (marker->blink_hz > 0) {
    const double period_us = 1e6 / marker->blink_hz;
    const double turns = 1e-6 * marker->blink_hz * begin_us + led_phase_;
    for (double cycle = std::floor(turns);; ++cycle) {
      const double on_us = (cycle - turns) * period_us;
      if (on_us >= duration_us) break;
      for (const double cut : {on_us, on_us + duty_ * period_us}) {
        if (cut < duration_us - kShortestStepUs) cut_at(cut);
      }
    }
  }
  cut_at(duration_us);
}

void EventSpheres::Shine(const Marker& marker, const SphereImage& image,
                         const EventClutter& clutter, const EventClutter::Moment& moment,
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
    clutter.LightOf(y, {patch.x, patch.x + patch.width}, moment, dark_row);
    std::copy(dark_row, dark_row + width, lit_row);
    if (HasRow(image.patch, y)) {
      const size_t first = IndexIn(image.patch, image.patch.x, y);
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
    if (!HasRow(marker.patch, y)) continue;
    const PixelSpan columns = marker.rows[static_cast<size_t>(y - marker.patch.y)];
    if (x < columns.begin || x >= columns.end) continue;
    const float cover = CoverAt(marker.images[part], x, y) + CoverAt(marker.images[part + 1], x, y);
    if (cover > most) owner = &marker, most = cover;
  }
  return owner;
}

void EventSpheres::Follow(int part, const EventClutter& clutter, const EventClutter::Moment& begin,
                          const EventClutter::Moment& end, EventPixels* pixels,
                          std::vector<PixelRequest>* requests) {
  const double part_us = static_cast<double>(cell_us_) / kDraws;
  const double begin_us = static_cast<double>(begin_us_) + part * part_us;
  for (Marker& marker : markers_) {
    const ImagePatch& patch = marker.patch;
    if (patch.empty()) continue;
    PlanSteps(begin_us, part_us, &marker);
    if (part == 0) {
      Shine(marker, marker.images[0], clutter, begin, &marker.dark[0], &marker.lit[0]);
    } else {
      marker.dark[0].swap(marker.dark[1]);
      marker.lit[0].swap(marker.lit[1]);
    }
    Shine(marker, marker.images[part + 1], clutter, end, &marker.dark[1], &marker.lit[1]);
    for (int y = patch.y; y < patch.y + patch.height; ++y) {
      const PixelSpan columns = marker.rows[static_cast<size_t>(y - patch.y)];
      for (int x = columns.begin, past = x; x < columns.end; x = past) {
        past = columns.end;
        if (!marker.alone) {
          const Marker* const owner = OwnerOf(x, y, part);
          for (past = x + 1; past < columns.end && OwnerOf(past, y, part) == owner;) ++past;
          if (owner != &marker) continue;
        }
        FollowColumns(marker, y, {x, past}, begin_us, pixels, requests);
      }
    }
  }
}

void EventSpheres::FollowColumns(const Marker& marker, int y, PixelSpan columns, double begin_us,
                                 EventPixels* pixels, std::vector<PixelRequest>* requests) {
  const size_t first = IndexIn(marker.patch, columns.begin, y);
  const auto count = static_cast<size_t>(columns.end - columns.begin);
  const auto column = static_cast<uint32_t>(columns.begin), row = static_cast<uint32_t>(y);
  for (size_t i = 0; begin_us == 0 && i < count; ++i) {
    pixels->Settle(column + static_cast<uint32_t>(i), row, marker.dark[0][first + i]);
  }
  from_.resize(count);
  to_.resize(count);
  const double whole_us = marker.steps.back().end_us;
  double from_us = 0;
  for (const LightStep& step : marker.steps) {
    const float* const before = (step.lit ? marker.lit : marker.dark)[0].data() + first;
    const float* const after = (step.lit ? marker.lit : marker.dark)[1].data() + first;
    const auto begin = static_cast<float>(from_us / whole_us);
    const auto end = static_cast<float>(step.end_us / whole_us);
    for (size_t i = 0; i < count; ++i) {
      from_[i] = before[i] + begin * (after[i] - before[i]);
      to_[i] = before[i] + end * (after[i] - before[i]);
    }
    pixels->FollowRow(column, row, from_, to_, begin_us + from_us, step.end_us - from_us, requests);
    from_us = step.end_us;
  }
}

}  // namespace rigcal
