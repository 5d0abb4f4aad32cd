// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event_board/event_board_detector.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <variant>

#include "agent/detect/event_board/burst_finder.h"
#include "agent/detect/event_board/event_bins.h"
#include "agent/detect/event_board/polarity_filter.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr double kSmoothPx = 0.8;  // of a picture of counts
// What a picture shows: values above this are discs, not noise, and so many pixels of them.
constexpr float kLeastValue = 1;
constexpr size_t kLeastPixels = 100;
constexpr double kWhiteQuantile = 0.9;
constexpr double kWhite = 255;
constexpr double kDiscGrey = 200, kMostGrey = 235;  // below white: of that quantile, and at most
// Of what moves the inside of a disc, and what it leaves behind, are uneven; its rim is not.
constexpr double kOutsideShare = 0.3, kInsideShare = 0.7;
constexpr int kLateMs = 2;                // events may come in another order
constexpr double kNeighbourUs = 400'000;  // pictures that tell how the board moves
constexpr int64_t kMotionEveryMs = 33;
constexpr int64_t kStillMs = 700;  // without a burst: it is no screen that blinks
constexpr uint64_t kMotionEvents = 1500;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

ImageView ViewOfGrey(const cv::Mat& grey) {
  return {.data = grey.data,
          .width = grey.cols,
          .height = grey.rows,
          .stride_bytes = static_cast<ptrdiff_t>(grey.step),
          .format = PixelFormat::kMono8};
}

// The value that becomes dark. 0: there is next to nothing.
float DarkValue(const cv::Mat1f& values) {
  std::vector<float> above;
  for (int y = 0; y < values.rows; ++y) {
    const float* const row = values.ptr<float>(y);
    for (int x = 0; x < values.cols; ++x) {
      if (row[x] > kLeastValue) above.push_back(row[x]);
    }
  }
  if (above.size() < kLeastPixels) return 0;
  const auto at = above.begin() +
                  static_cast<ptrdiff_t>(kWhiteQuantile * static_cast<double>(above.size() - 1));
  std::nth_element(above.begin(), at, above.end());
  return *at;
}

// `values` as darkness on white: up to `from` none, from `to` on all of it.
cv::Mat DarkOnWhite(const cv::Mat1f& values, double from, double to) {
  cv::Mat grey;
  const double scale = kDiscGrey / (to - from);
  values.convertTo(grey, CV_8U, -scale, kWhite + scale * from);
  cv::max(grey, kWhite - kMostGrey, grey);
  return grey;
}

}  // namespace

struct EventBoardDetector::Impl {
  Impl(const Board& board_in, SensorGeometry geometry_in, AnyEventDecoder decoder_in)
      : board(board_in), geometry(geometry_in), decoder(std::move(decoder_in)), filter(geometry) {}

  void Events(std::span<const PackedEvent> events) {
    for (const PackedEvent& event : events) {
      const int64_t time_us =
          now_us + static_cast<int32_t>(event.time_us - static_cast<uint32_t>(now_us));
      now_us = std::max(now_us, time_us);
      bins.Add(time_us, event);
      flicker.Take(time_us, event.on());
    }
    counts.events += events.size();
    Advance(bins.last_ms() - kLateMs);
  }
  void Trigger(const TriggerEvent&) {}
  void TimeStepBack(int64_t time_us) {
    EndEpoch();
    ++epoch;
    now_us = time_us;
  }

  void EndEpoch() {
    if (!bins.empty()) Advance(bins.last_ms() + BurstFinder::kMostMs);
    Emit(nullptr);
    before.reset();
    bins.Clear();
    next_ms.reset();
    filter.Clear();
    counts.bursts += finder.bursts();
    counts.too_quick += finder.too_quick();
    if (finder.BlinkHz() > 0) counts.blink_hz = finder.BlinkHz();
    finder = BurstFinder();
    last_burst_ms.reset();
  }

  // Looks at the milliseconds up to this one.
  void Advance(int64_t until_ms) {
    if (!next_ms) next_ms = bins.last_ms();
    if (until_ms - *next_ms > static_cast<int64_t>(EventBins::kKept)) {
      next_ms = until_ms - static_cast<int64_t>(EventBins::kKept);
    }
    for (; *next_ms <= until_ms; ++*next_ms) {
      const EventBin* const bin = bins.At(*next_ms);
      const auto burst = bin == nullptr ? finder.Take(*next_ms, 0, 0)
                                        : finder.Take(*next_ms, bin->events.size(), bin->net);
      if (bin != nullptr) {
        for (const PackedEvent& event : bin->events) filter.Take(event);
        recent_events += bin->events.size();
      }
      if (burst) {
        last_burst_ms = *next_ms;
        flicker.Forget(burst->first_ms * 1000, (burst->last_ms + 1) * 1000);
        if (status.ok()) status = LookAtBurst(*burst);
      } else if (IsMotionDue()) {
        if (status.ok()) status = LookAtMotion();
      }
    }
  }

  bool IsMotionDue() {
    if (last_burst_ms && *next_ms - *last_burst_ms < kStillMs) return false;
    if (!motion_ms) motion_ms = *next_ms + kStillMs;
    if (*next_ms < *motion_ms) return false;
    motion_ms = *next_ms + kMotionEveryMs;
    return std::exchange(recent_events, 0) >= kMotionEvents;
  }

  cv::Mat1f NetOf(const Burst& burst) const {
    cv::Mat1f net(static_cast<int>(geometry.height), static_cast<int>(geometry.width), 0.0f);
    for (int64_t ms = burst.first_ms; ms <= burst.last_ms; ++ms) {
      const EventBin* const bin = bins.At(ms);
      if (bin == nullptr) continue;
      for (const PackedEvent& event : bin->events) {
        net(event.y(), event.x) += event.on() == burst.on ? 1.0f : -1.0f;
      }
    }
    return net;
  }

  // The sum of a pixel's changes is what it sees at the end less what it saw at the beginning, and
  // one of both is dark: the picture is that of one instant, wherever the screen's rows began and
  // however the discs moved in between.
  absl::Status LookAtBurst(const Burst& burst) {
    cv::Mat1f net = NetOf(burst);
    cv::GaussianBlur(net, net, cv::Size(0, 0), kSmoothPx);
    const float dark = DarkValue(net);
    if (!(dark > 0)) return absl::OkStatus();
    EventBoardPicture picture;
    picture.kind = EventBoardPicture::Kind::kBurst;
    picture.time_us = 1e3 * static_cast<double>(burst.on ? burst.last_ms + 1 : burst.first_ms);
    picture.grey = DarkOnWhite(net, 0, dark);
    RIGCAL_RETURN_IF_ERROR(Search(&picture));
    Emit(&picture);
    return absl::OkStatus();
  }

  absl::Status LookAtMotion() {
    const int64_t end_us = (*next_ms + 1) * 1000;
    cv::Mat1f level = filter.PictureAt(static_cast<uint32_t>(end_us));
    cv::GaussianBlur(level, level, cv::Size(0, 0), 1.0);
    EventBoardPicture picture;
    picture.kind = EventBoardPicture::Kind::kMotion;
    picture.time_us = static_cast<double>(end_us);
    // Dark discs on white, as printed; else white ones on dark.
    for (int turn = 0; turn < 2 && !picture.seen; ++turn) {
      const cv::Mat1f values = is_white_on_dark == (turn == 0) ? level : cv::Mat1f(-level);
      const float dark = DarkValue(values);
      if (!(dark > 0)) continue;
      picture.grey = DarkOnWhite(values, kOutsideShare * dark, kInsideShare * dark);
      RIGCAL_RETURN_IF_ERROR(Search(&picture));
      if (picture.seen && turn == 1) is_white_on_dark = !is_white_on_dark;
      --counts.pictures;
    }
    if (picture.grey.empty()) return absl::OkStatus();
    ++counts.pictures;
    Emit(&picture);
    return absl::OkStatus();
  }

  absl::Status Search(EventBoardPicture* picture) {
    ++counts.pictures;
    picture->clock_epoch = epoch;
    RIGCAL_ASSIGN_OR_RETURN(picture->seen,
                            FindBoard(board, ViewOfGrey(picture->grey), BoardSearch::kQuick));
    if (picture->seen) ++counts.boards;
    return absl::OkStatus();
  }

  // `next` waits for the one behind it; the one that waited is told now.
  void Emit(EventBoardPicture* next) {
    if (waiting) {
      waiting->speed_px_s = SpeedOf(Near(before ? &*before : nullptr), Near(next));
      before = *waiting;
      before->grey = cv::Mat();
      found->push_back(*std::move(waiting));
      waiting.reset();
    }
    if (next != nullptr) waiting = std::move(*next);
  }
  // The picture, if it tells how the board moves in the one that waits.
  const EventBoardPicture* Near(const EventBoardPicture* other) const {
    const bool is_near = other != nullptr && other->seen && waiting->seen &&
                         std::abs(other->time_us - waiting->time_us) < kNeighbourUs;
    return is_near ? other : nullptr;
  }
  double SpeedOf(const EventBoardPicture* from, const EventBoardPicture* to) const {
    if (from == nullptr) from = &*waiting;
    if (to == nullptr) to = &*waiting;
    if (!(to->time_us > from->time_us)) return kNan;
    std::vector<double> ways_px;
    for (size_t i = 0; i < from->seen->pixels.size(); ++i) {
      ways_px.push_back((to->seen->pixels[i] - from->seen->pixels[i]).norm());
    }
    return 1e6 * UpperMedian(std::move(ways_px)) / (to->time_us - from->time_us);
  }

  const Board board;
  const SensorGeometry geometry;
  AnyEventDecoder decoder;
  EventBins bins;
  BurstFinder finder;
  FlickerMeter flicker;
  PolarityFilter filter;
  bool is_started = false;
  int64_t now_us = 0;
  uint32_t epoch = 0;
  std::optional<int64_t> next_ms, last_burst_ms, motion_ms;
  uint64_t recent_events = 0;
  bool is_white_on_dark = false;
  std::optional<EventBoardPicture> before, waiting;
  EventBoardCounts counts;
  std::vector<EventBoardPicture>* found = nullptr;  // while bytes are taken
  absl::Status status;
};

namespace {

struct TimeOnly {
  bool seen = false;
  uint32_t first_us = 0;
  void Events(std::span<const PackedEvent> events) {
    if (!std::exchange(seen, true)) first_us = events.front().time_us;
  }
  void Trigger(const TriggerEvent&) {}
  void TimeStepBack(int64_t) { seen = false; }
};

// Of the first event in these bytes, with all its bits; 0: there is none.
template <typename Decoder>
int64_t FirstTime(Decoder decoder, std::span<const uint8_t> bytes) {
  TimeOnly first;
  DecodeInBatches(decoder, bytes, first);
  const int64_t last_us = decoder.time_us();
  if (!first.seen) return last_us;
  return last_us + static_cast<int32_t>(first.first_us - static_cast<uint32_t>(last_us));
}

}  // namespace

EventBoardDetector::EventBoardDetector(const Board& board, SensorGeometry geometry,
                                       EventFormat format, bool halves_swapped)
    : impl_(std::make_unique<Impl>(board, geometry,
                                   MakeEventDecoder(format, halves_swapped, geometry))) {}
EventBoardDetector::EventBoardDetector(EventBoardDetector&&) noexcept = default;
EventBoardDetector& EventBoardDetector::operator=(EventBoardDetector&&) noexcept = default;
EventBoardDetector::~EventBoardDetector() = default;

absl::Status EventBoardDetector::Take(std::span<const uint8_t> bytes,
                                      std::vector<EventBoardPicture>* pictures) {
  impl_->found = pictures;
  std::visit(
      [&](auto& decoder) {
        if (impl_->counts.events == 0) impl_->now_us = FirstTime(decoder, bytes);
        DecodeInBatches(decoder, bytes, *impl_);
      },
      impl_->decoder);
  impl_->found = nullptr;
  return impl_->status;
}

absl::Status EventBoardDetector::Finish(std::vector<EventBoardPicture>* pictures) {
  impl_->found = pictures;
  impl_->EndEpoch();
  impl_->found = nullptr;
  return impl_->status;
}

const EventFaults& EventBoardDetector::faults() const {
  return std::visit([](const auto& decoder) -> const EventFaults& { return decoder.faults(); },
                    impl_->decoder);
}

EventBoardCounts EventBoardDetector::counts() const {
  EventBoardCounts counts = impl_->counts;
  counts.bursts += impl_->finder.bursts();
  counts.too_quick += impl_->finder.too_quick();
  if (impl_->finder.BlinkHz() > 0) counts.blink_hz = impl_->finder.BlinkHz();
  counts.flicker_hz = impl_->flicker.FlickerHz();
  return counts;
}

}  // namespace rigcal::agent
