// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_wand_detector.h"

#include <optional>
#include <type_traits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/detect/event/blink_frequencies.h"
#include "agent/detect/event/blink_wand_timeline.h"
#include "agent/event/any_event_decoder.h"

namespace rigcal::agent {
namespace {

constexpr int kMaxFits = 8000;  // a wall of lamps must not take longer than a sensor waits

WandFinderOptions FinderOptions(const WandLimits& limits, const BlinkFrequencies& frequencies) {
  WandFinderOptions result{.limits = limits, .max_fits = kMaxFits};
  if (frequencies.hz.size() > 1) result.marker_kinds = frequencies.of_marker;
  return result;
}

absl::InlinedVector<double, 3> MarkerPeriods(const BlinkFrequencies& frequencies) {
  absl::InlinedVector<double, 3> period_us;
  for (const int index : frequencies.of_marker) {
    period_us.push_back(1e6 / frequencies.hz[static_cast<size_t>(index)]);
  }
  return period_us;
}

}  // namespace

absl::Status BlinkWandDetectorOptions::Validate() const {
  FaultList faults;
  faults.Add(output.Validate());
  faults.Add(BlinkFilterOptions{*this, {1, 1}, {blink_hz}}.Validate());
  WandLimits::Check(&faults);
  return faults.Result("event wand detector: ");
}

struct BlinkWandDetector::Impl {
  Impl(const BlinkWandDetectorOptions& options, const Target& target,
       const CameraDescription& camera, const BlinkFrequencies& frequencies,
       AnyEventDecoder decoder_in, BlinkFilter filter)
      : decoder(decoder_in),
        timeline(std::move(filter),
                 BlinkWandVerifier(FinderOptions(options, frequencies), target, camera),
                 options.output, MarkerPeriods(frequencies)) {}

  AnyEventDecoder decoder;
  FaultLocator fault_locator;
  BlinkWandTimeline timeline;
};

namespace {

// Feeds the filter with a decoder's batches of events, stopped whenever something is due.
struct StoppingConsumer {
  BlinkWandTimeline* timeline;
  uint32_t stop_us;

  bool IsDue(const PackedEvent& event) const {
    return static_cast<int32_t>(event.time_us - stop_us) >= 0;
  }
  bool IsAnyDue(std::span<const PackedEvent> events) const {
    bool any = false;
    for (const PackedEvent& event : events) any |= IsDue(event);
    return any;
  }
  void Events(std::span<const PackedEvent> events) {
    while (IsAnyDue(events)) {
      size_t next = 0;
      while (!IsDue(events[next])) ++next;
      timeline->Feed(events.first(next));
      stop_us = timeline->Reach(events[next].time_us);
      timeline->Feed(events.subspan(next, 1));
      events = events.subspan(next + 1);
    }
    timeline->Feed(events);
  }
  void Trigger(const TriggerEvent& trigger) { stop_us = timeline->TakeTrigger(trigger); }
  void TimeStepBack(int64_t time_us) { stop_us = timeline->StepBack(time_us); }
};

struct FirstTimeSink {
  bool seen = false;
  uint32_t first_us = 0;

  void Event(uint32_t, uint32_t, bool, uint32_t time_us) { Take(time_us); }
  void Vector(uint32_t, uint32_t, bool, uint32_t time_us, uint32_t) { Take(time_us); }
  void Trigger(const TriggerEvent& trigger) { Take(static_cast<uint32_t>(trigger.time_us)); }
  void TimeStepBack(int64_t) { seen = false; }
  void Take(uint32_t time_us) {
    if (!seen) first_us = time_us;
    seen = true;
  }
};

// Of the first event in these bytes.
template <typename Decoder>
std::optional<int64_t> FirstTime(Decoder decoder, std::span<const uint8_t> bytes) {
  FirstTimeSink sink;
  decoder.Decode(bytes, sink);
  if (!sink.seen) return std::nullopt;
  const auto last_us = static_cast<uint32_t>(decoder.time_us());
  return decoder.time_us() + static_cast<int32_t>(sink.first_us - last_us);
}

template <typename Decoder>
int64_t SafeTime(const Decoder& decoder) {
  // TIME_HIGH alone: the lower bits may still be those of the one before.
  constexpr int64_t kUnsafe = std::is_same_v<Decoder, Evt3Decoder> ? 0xfff : 0;
  return decoder.time_us() & ~kUnsafe;
}

}  // namespace

BlinkWandDetector::BlinkWandDetector(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
BlinkWandDetector::BlinkWandDetector(BlinkWandDetector&&) noexcept = default;
BlinkWandDetector& BlinkWandDetector::operator=(BlinkWandDetector&&) noexcept = default;
BlinkWandDetector::~BlinkWandDetector() = default;

absl::StatusOr<BlinkWandDetector> BlinkWandDetector::Create(const BlinkWandDetectorOptions& options,
                                                            const Target& target,
                                                            const CameraDescription& camera,
                                                            EventFormat format,
                                                            bool halves_swapped) {
  absl::Status status = options.Validate();
  status.Update(CheckTargetAndCamera(target, camera));
  const SensorGeometry geometry{camera.image_size_px.width, camera.image_size_px.height};
  if (status.ok()) {
    const BlinkFrequencies frequencies = BlinkFrequenciesOf(target, options.blink_hz);
    auto filter = BlinkFilter::Create({options, geometry, frequencies.hz});
    if (filter.ok()) {
      return BlinkWandDetector(std::make_unique<Impl>(
          options, target, camera, frequencies, MakeEventDecoder(format, halves_swapped, geometry),
          *std::move(filter)));
    }
    status = filter.status();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("camera ", camera.camera, ": ", std::string(status.message())));
}

void BlinkWandDetector::Take(std::span<const uint8_t> bytes, std::vector<Detection>* found) {
  BlinkWandTimeline& timeline = impl_->timeline;
  timeline.BeginTake(bytes.size(), found);
  std::visit(
      [&](auto& decoder) {
        if (!timeline.has_begun()) {
          const std::optional<int64_t> first_us = FirstTime(decoder, bytes);
          if (first_us) timeline.Begin(*first_us);
        }
        const auto before = decoder;
        StoppingConsumer consumer{&timeline, timeline.NextStop()};
        DecodeInBatches(decoder, bytes, consumer);
        impl_->fault_locator.Look(before, bytes, decoder.faults());
        if (timeline.has_begun()) timeline.AdvanceTo(SafeTime(decoder));
      },
      impl_->decoder);
  timeline.EndTake();
}

void BlinkWandDetector::Finish(std::vector<Detection>* found) {
  // Of the last event, however the stream was cut.
  const int64_t last_us =
      std::visit([](const auto& decoder) { return decoder.time_us(); }, impl_->decoder);
  impl_->timeline.Finish(last_us, found);
}

std::vector<LampReading> BlinkWandDetector::TakeLampReadings() {
  return impl_->timeline.TakeLampReadings();
}

const EventFaults& BlinkWandDetector::faults() const {
  return std::visit([](const auto& decoder) -> const EventFaults& { return decoder.faults(); },
                    impl_->decoder);
}

const FaultPlaces& BlinkWandDetector::fault_places() const { return impl_->fault_locator.places(); }

const BlinkWandCounts& BlinkWandDetector::counts() const { return impl_->timeline.counts(); }

}  // namespace rigcal::agent
