// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/flash_measurer.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>

#include "agent/detect/event/burst_shape.h"
#include "agent/detect/event/wrapped_time.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::agent {
namespace {

// Around a blob: pixels that answer though little of the marker covers them, and what it moves. The
// flash may be up to two periods away from the burst that the blob was found by; what is left out
// at one side moves the centre to the other.
constexpr float kAroundPx = 5, kFlashMotionPxPerUs = 1e-3f, kMotionPeriods = 2;
// Of a blob's area: fewer pixels are not its answer to a flash.
constexpr double kLeastShare = 0.4;
// Of the events about a flash: those before are of edges that move.
constexpr double kEarlyShare = 0.1;
// Of a period: by which the earliest may come before those.
constexpr double kEarly = 0.02;
// Of a period: width in which the fall of a light that is not known is looked for.
constexpr double kFallShare = 0.1;
// Of a period: a light that shines shorter, or is dark shorter, is not followed.
constexpr double kLeastPhase = 0.08;
// Of a period: pixels that answer one switch of the light only are blind for about so long after
// any event. Those that the marker's edge made fire so shortly before the switch cannot answer it.
constexpr double kBlindShare = 0.3;
// Of a period: a pixel at the front begins to answer with the first switch after the edge has come
// to it. So those that answer the fall show where the marker was so much earlier, those that answer
// the rise where it will be so much later. Seen with the simulator's sensor and refractory period,
// contrasts of 1:1 to 1:3; the rest of the way is no time (BlinkWandVerifier).
constexpr double kOneSwitchShare = 0.2;
// The same by the rise of pixels that answer the fall, too, but so late that it is not measured.
constexpr double kLateFallShare = 0.1;

// At the rim pixels answer by chance.
constexpr double kLooseRimPx = 1;

struct PixelBox {
  int min_x = std::numeric_limits<int>::max(), min_y = std::numeric_limits<int>::max();
  int max_x = -1, max_y = -1;

  void Add(int x, int y) {
    min_x = std::min(min_x, x), max_x = std::max(max_x, x);
    min_y = std::min(min_y, y), max_y = std::max(max_y, y);
  }
  bool Has(int x, int y) const { return x >= min_x && x <= max_x && y >= min_y && y <= max_y; }
  int width() const { return max_x - min_x + 1; }
  int height() const { return max_y - min_y + 1; }
  size_t IndexOf(int x, int y) const {
    return static_cast<size_t>(y - min_y) * static_cast<size_t>(width()) +
           static_cast<size_t>(x - min_x);
  }
};

// Of the pixels within the ellipse of these moments, but for its rim.
template <typename Answered>
double AnsweredShare(const Blob& shape, const Answered& answered) {
  const Eigen::Matrix2d extent = shape.second_moment_px2 + Eigen::Matrix2d::Identity() / 12;
  const Eigen::Matrix2d inverse = extent.inverse();
  const double limit = 4 * std::pow(std::max(0.5, 1 - kLooseRimPx / RadiusPx(shape)), 2);
  int all = 0, lit = 0;
  for (int y = shape.box.y; y < shape.box.y + shape.box.height; ++y) {
    for (int x = shape.box.x; x < shape.box.x + shape.box.width; ++x) {
      const Eigen::Vector2d d = Eigen::Vector2d(x, y) - shape.centre_px;
      if (d.dot(inverse * d) > limit) continue;
      ++all;
      lit += answered(x, y) ? 1 : 0;
    }
  }
  return all > 0 ? static_cast<double>(lit) / all : 1;
}

// A part of the answers to this switch of the light.
bool IsFlashInGap(const EventGaps& gaps, const BlinkLight& light, double switch_us) {
  return gaps.Overlap(WrappedUs(switch_us - light.MarginUs()),
                      WrappedUs(switch_us + light.AnswerUs() + light.MarginUs()));
}

// Its disc reaches beyond the border. That a pixel of its rim lies there says little: pixels answer
// up to two pixels outside a sphere.
bool IsCut(const Blob& shape, const SensorGeometry& geometry) {
  const double to_left = shape.centre_px.x() + 0.5, to_top = shape.centre_px.y() + 0.5;
  const double nearest_px =
      std::min({to_left, geometry.width - to_left, to_top, geometry.height - to_top});
  return TouchesBorder(shape.box, geometry) && nearest_px < RadiusPx(shape);
}

}  // namespace

void FlashMeasurer::Collect(std::span<const PackedEvent> events, double due_us,
                            const std::vector<BlinkBlob>& blobs) {
  largest_.resize(blobs.size());
  std::iota(largest_.begin(), largest_.end(), size_t{0});
  if (largest_.size() > kMaxBlobs) {
    std::stable_sort(largest_.begin(), largest_.end(),
                     [&](size_t a, size_t b) { return blobs[a].area_px > blobs[b].area_px; });
    largest_.resize(kMaxBlobs);
  }
  answers_.resize(std::max(answers_.size(), largest_.size()));
  for (std::vector<Answer>& answers : answers_) answers.clear();
  struct Disc {
    float x, y, radius2, reach2;
  };
  std::vector<Disc> discs;
  for (const size_t index : largest_) {
    const auto radius = static_cast<float>(RadiusPx(blobs[index]));
    const float reach =
        radius + kAroundPx +
        kMotionPeriods * kFlashMotionPxPerUs * static_cast<float>(blobs[index].period_us);
    discs.push_back({static_cast<float>(blobs[index].centre_px.x()),
                     static_cast<float>(blobs[index].centre_px.y()), radius * radius,
                     reach * reach});
  }
  // Modulo 2^32 us, the nearer way round, as SinceUs.
  const double whole_us = std::floor(due_us);
  const auto due = static_cast<uint32_t>(static_cast<int64_t>(whole_us));
  const double rest_us = due_us - whole_us;
  for (const PackedEvent& event : events) {
    // Of markers that touch each other, the one in whose terms the pixel is nearest.
    size_t nearest = discs.size();
    float least = std::numeric_limits<float>::infinity();
    const auto x = static_cast<float>(event.x), y = static_cast<float>(event.y());
    for (size_t i = 0; i < discs.size(); ++i) {
      const float dx = x - discs[i].x, dy = y - discs[i].y;
      const float away2 = dx * dx + dy * dy, power = away2 - discs[i].radius2;
      const bool is_nearer = away2 <= discs[i].reach2 && power < least;
      nearest = is_nearer ? i : nearest;
      least = is_nearer ? power : least;
    }
    if (nearest == discs.size()) continue;
    const double since_due_us = static_cast<int32_t>(event.time_us - due) - rest_us;
    answers_[nearest].push_back({static_cast<float>(since_due_us), event.x, event.y(), event.on()});
  }
}

std::optional<BlinkLight> FlashMeasurer::FindLight(const BlinkBlob& blob,
                                                   const std::vector<Answer>& answers,
                                                   double due_us, double from_us, double until_us) {
  const double period_us = blob.period_us;
  if (until_us - from_us < 2 * period_us) return std::nullopt;
  // The first rise after the beginning.
  const double burst_us = SinceUs(due_us, blob.burst_us);
  const double margin_us = kFallShare * period_us;
  const double on_us =
      burst_us + std::ceil((from_us + margin_us - burst_us) / period_us) * period_us;
  times_us_.clear();
  for (const Answer& answer : answers) {
    const double since_us = answer.since_due_us - on_us;
    if (answer.on || since_us < 0 || since_us > period_us) continue;
    times_us_.push_back(static_cast<float>(since_us));
  }
  std::sort(times_us_.begin(), times_us_.end());
  size_t most = 0, best = 0;
  for (size_t begin = 0, end = 0; begin < times_us_.size(); ++begin) {
    while (end < times_us_.size() && times_us_[end] - times_us_[begin] < margin_us) ++end;
    if (end - begin > most) most = end - begin, best = begin + (end - begin) / 2;
  }
  if (static_cast<double>(most) < std::max<double>(min_pixels_, kLeastShare * blob.area_px)) {
    return std::nullopt;
  }
  const double lit_us = times_us_[best];
  if (std::min(lit_us, period_us - lit_us) < kLeastPhase * period_us) return std::nullopt;
  return BlinkLight{.frequency = blob.frequency,
                    .on_us = due_us + on_us,
                    .period_us = period_us,
                    .lit_us = lit_us};
}

std::optional<FlashMeasurer::Flash> FlashMeasurer::MeasureFlash(const std::vector<Answer>& answers,
                                                                bool on, double begin_us,
                                                                const BlinkLight& light,
                                                                int least_pixels) {
  const double margin_us = light.MarginUs(), answer_us = light.AnswerUs();
  const auto for_each_within = [&](double from_us, double until_us, const auto& take) {
    const auto from = static_cast<float>(from_us), until = static_cast<float>(until_us);
    for (const Answer& answer : answers) {
      if (answer.on == on && answer.since_due_us >= from && answer.since_due_us <= until) {
        take(answer);
      }
    }
  };
  times_us_.clear();
  for_each_within(begin_us - margin_us, begin_us + margin_us + answer_us,
                  [&](const Answer& answer) { times_us_.push_back(answer.since_due_us); });
  if (static_cast<int>(times_us_.size()) < least_pixels) return std::nullopt;
  const double earliest_us = LowerQuantile(&times_us_, kEarlyShare) - kEarly * light.period_us;
  flash_.clear();
  PixelBox box;
  for_each_within(earliest_us, earliest_us + answer_us, [&](const Answer& answer) {
    flash_.push_back(answer);
    box.Add(answer.x, answer.y);
  });
  if (static_cast<int>(flash_.size()) < least_pixels) return std::nullopt;
  const size_t answered = flash_.size();
  for (const Answer& answer : answers) {
    const double early_us = earliest_us - answer.since_due_us;
    if (early_us <= 0 || early_us > light.before_us) continue;
    flash_.push_back(answer);
    box.Add(answer.x, answer.y);
  }
  // Each pixel's first.
  constexpr float kNone = std::numeric_limits<float>::infinity(), kBefore = -kNone;
  first_us_.assign(static_cast<size_t>(box.width()) * static_cast<size_t>(box.height()), kNone);
  for (size_t i = 0; i < flash_.size(); ++i) {
    float& first_us = first_us_[box.IndexOf(flash_[i].x, flash_[i].y)];
    if (i < answered) {
      first_us = std::min(first_us, flash_[i].since_due_us);
    } else if (first_us == kNone) {
      first_us = kBefore;
    }
  }
  times_us_.clear();
  pixels_.clear();
  size_t index = 0;
  for (int y = box.min_y; y <= box.max_y; ++y) {
    for (int x = box.min_x; x <= box.max_x; ++x) {
      const float first_us = first_us_[index++];
      if (first_us == kNone) continue;
      pixels_.emplace_back(x, y);
      if (first_us != kBefore) times_us_.push_back(first_us);
    }
  }
  Smooth(&pixels_);
  if (static_cast<int>(pixels_.size()) < least_pixels) return std::nullopt;
  Flash flash;
  flash.time_us = UpperMedian(&times_us_);
  flash.shape = MarkerShapeOf(&pixels_);
  flash.answered_share = AnsweredShare(flash.shape, [&](int x, int y) {
    return box.Has(x, y) && first_us_[box.IndexOf(x, y)] != kNone;
  });
  return flash;
}

void FlashMeasurer::Measure(const FlashRecorder& recorder, double due_us, const EventGaps& gaps,
                            BlinkLights* lights, std::vector<BlinkBlob>* blobs) {
  if (recorder.events().empty()) return;
  Collect(recorder.events(), due_us, *blobs);
  const auto since_due = [due_us](int64_t time_us) {
    return SinceUs(due_us, static_cast<double>(static_cast<uint32_t>(time_us)));
  };
  const BlinkLights known = *lights;  // what was recorded is about these
  for (size_t i = 0; i < largest_.size(); ++i) {
    BlinkBlob& blob = (*blobs)[largest_[i]];
    std::optional<BlinkLight> light;
    if (const BlinkLight* const found = known.Find(blob.frequency, blob.burst_us)) {
      light = *found;
    } else if (recorder.all_from_us() != recorder.all_until_us()) {
      light = FindLight(blob, answers_[i], due_us, since_due(recorder.all_from_us()),
                        since_due(recorder.all_until_us()));
      if (light) lights->Take(*light);
    }
    if (!light) continue;
    blob.time_us = blob.burst_us + 0.5 * light->lit_us;
    const double on_us = SinceUs(due_us, light->LastOn(due_us));
    if (IsFlashInGap(gaps, *light, due_us + on_us) ||
        IsFlashInGap(gaps, *light, due_us + on_us + light->lit_us)) {
      blob.beside_gap = true;
      continue;
    }
    const int least = std::max(min_pixels_, static_cast<int>(kLeastShare * blob.area_px));
    const auto rise = MeasureFlash(answers_[i], true, on_us, *light, least);
    const auto fall = MeasureFlash(answers_[i], false, on_us + light->lit_us, *light, least);
    if (!rise || !fall) continue;
    blob.centre_px = 0.5 * (rise->shape.centre_px + fall->shape.centre_px);
    blob.second_moment_px2 = 0.5 * (rise->shape.second_moment_px2 + fall->shape.second_moment_px2);
    blob.area_px = (rise->shape.area_px + fall->shape.area_px) / 2;
    blob.box = rise->shape.box;
    blob.touches_border = IsCut(rise->shape, geometry_) || IsCut(fall->shape, geometry_);
    blob.burst_us = due_us + rise->time_us;
    blob.time_us = due_us + 0.5 * (rise->time_us + fall->time_us);
    blob.rise_to_fall_px = fall->shape.centre_px - rise->shape.centre_px;
    blob.answered_share = 0.5 * (rise->answered_share + fall->answered_share);
    blob.is_timed = true;
    light->on_us = blob.burst_us;
    light->lit_us = fall->time_us - rise->time_us;
    lights->Take(*light);
  }
}

void FlashMeasurer::MeasureOneSwitch(const FlashRecorder& recorder, PixelAnswers answers,
                                     double due_us, const EventGaps& gaps, BlinkLights* lights,
                                     std::vector<BlinkBlob>* blobs) {
  const bool on = answers != PixelAnswers::kFall;
  const double share = answers == PixelAnswers::kBoth ? kLateFallShare : kOneSwitchShare;
  const auto shown_at = [on, share](const BlinkBlob& blob) {
    return blob.burst_us + (on ? share : -share) * blob.period_us;
  };
  Collect(recorder.events(), due_us, *blobs);
  for (BlinkBlob& blob : *blobs) {
    blob.time_us = shown_at(blob);
    blob.ahead = on ? 1 : -1;
  }
  const BlinkLights known = *lights;  // what was recorded is about these
  for (size_t i = 0; i < largest_.size(); ++i) {
    BlinkBlob& blob = (*blobs)[largest_[i]];
    BlinkLight light = {.frequency = blob.frequency,
                        .on_us = blob.burst_us,
                        .period_us = blob.period_us,
                        .lit_us = 0.5 * blob.period_us,
                        .before_us = kBlindShare * blob.period_us};
    if (const BlinkLight* const found = known.Find(blob.frequency, blob.burst_us)) {
      light = *found;
      const double switch_us = SinceUs(due_us, light.LastOn(due_us));
      if (IsFlashInGap(gaps, light, due_us + switch_us)) {
        blob.beside_gap = true;
        continue;
      }
      const int least = std::max(min_pixels_, static_cast<int>(kLeastShare * blob.area_px));
      const auto flash = MeasureFlash(answers_[i], on, switch_us, light, least);
      if (!flash) continue;
      static_cast<Blob&>(blob) = flash->shape;
      blob.answered_share = flash->answered_share;
      blob.touches_border = IsCut(flash->shape, geometry_);
      blob.burst_us = light.on_us = due_us + flash->time_us;
      blob.time_us = shown_at(blob);
    }
    lights->Take(light);
  }
}

}  // namespace rigcal::agent
