// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_wand_detector.h"

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "absl/container/inlined_vector.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "agent/detect/event/blink_filter.h"
#include "agent/detect/event/blink_frequencies.h"
#include "agent/detect/event/blink_wand_timeline.h"
#include "agent/detect/event/blink_wand_verifier.h"
#include "agent/detect/event/stopping_consumer.h"
#include "agent/event/event_decoder.h"
#include "agent/event/plain_events.h"

namespace rigcal::agent {
namespace {

constexpr int kMaxFits = 8000;  // a wall of lamps must not take longer than a sensor waits

using Decoder = std::variant<Evt2Decoder, Evt21Decoder, Evt3Decoder, PlainEventDecoder>;

Decoder MakeDecoder(EventFormat format, bool halves_swapped, SensorGeometry geometry) {
  switch (format) {
    case EventFormat::kEvt2:
      return Evt2Decoder(geometry);
    case EventFormat::kEvt21:
      return Evt21Decoder(geometry, halves_swapped);
    case EventFormat::kPlain:
      return PlainEventDecoder(geometry);
    case EventFormat::kEvt3:
      break;
  }
  return Evt3Decoder(geometry);
}

SensorGeometry GeometryOf(const CameraDescription& camera) {
  return {camera.image_size_px.width, camera.image_size_px.height};
}

WandFinderOptions FinderOptions(const BlinkWandDetectorOptions& options,
                                const BlinkFrequencies& frequencies) {
  WandFinderOptions result;
  result.min_distance_m = options.min_distance_m;
  result.max_distance_m = options.max_distance_m;
  result.max_tilt_deg = options.max_tilt_deg;
  result.max_fits = kMaxFits;
  if (frequencies.hz.size() > 1) result.marker_kinds = frequencies.of_marker;
  return result;
}

BlinkFilterOptions FilterOptions(const BlinkWandDetectorOptions& options,
                                 const CameraDescription& camera,
                                 const std::vector<double>& blink_hz) {
  return {.geometry = GeometryOf(camera),
          .blink_hz = blink_hz,
          .band_rel = options.band_rel,
          .min_periods = options.min_periods,
          .min_blob_pixels = options.min_blob_pixels,
          .reach_px = options.reach_px};
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
  std::vector<std::string> faults;
  if (const absl::Status status = output.Validate(); !status.ok()) {
    faults.emplace_back(status.message());
  }
  CameraDescription any;
  any.image_size_px = {1, 1};
  if (const absl::Status status = FilterOptions(*this, any, {blink_hz}).Validate(); !status.ok()) {
    faults.emplace_back(status.message());
  }
  const auto check = [&faults](const char* name, double value, double low, double high) {
    if (value >= low && value <= high) return;
    faults.push_back(absl::StrCat(name, " is ", value, ", it must be ", low, " to ", high));
  };
  check("min_distance", min_distance_m, 0.01, 1000);
  check("max_distance", max_distance_m, 0.01, 1000);
  if (!(min_distance_m < max_distance_m)) {
    faults.push_back(absl::StrCat("min_distance (", min_distance_m,
                                  " m) must be less than max_distance (", max_distance_m, " m)"));
  }
  check("max_tilt", max_tilt_deg, 10, 89);
  check("min_confidence", min_confidence, 0, 1);
  if (faults.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("event wand detector: ", absl::StrJoin(faults, "; ")));
}

struct BlinkWandDetector::Impl {
  Impl(const BlinkWandDetectorOptions& options, const Target& target,
       const CameraDescription& camera, const BlinkFrequencies& frequencies, Decoder decoder_in,
       BlinkFilter filter)
      : decoder(decoder_in),
        timeline(std::move(filter),
                 BlinkWandVerifier(FinderOptions(options, frequencies), options.min_confidence,
                                   target, camera),
                 options.output, MarkerPeriods(frequencies)) {}

  Decoder decoder;
  FaultLocator fault_locator;
  BlinkWandTimeline timeline;
};

namespace {

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

// TIME_HIGH alone: the lower bits may still be those of the one before.
int64_t SafeTime(const Evt3Decoder& decoder) { return decoder.time_us() & ~int64_t{0xfff}; }
int64_t SafeTime(const Evt21Decoder& decoder) { return decoder.time_us(); }
int64_t SafeTime(const Evt2Decoder& decoder) { return decoder.time_us(); }
int64_t SafeTime(const PlainEventDecoder& decoder) { return decoder.time_us(); }

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
  const auto named = [&camera](const absl::Status& status) {
    return absl::InvalidArgumentError(
        absl::StrCat("camera ", camera.camera, ": ", std::string(status.message())));
  };
  if (const auto status = options.Validate(); !status.ok()) return named(status);
  if (const auto status = target.Validate(); !status.ok()) return named(status);
  if (camera.intrinsics) {
    const auto status = camera.intrinsics->Validate(camera.image_size_px);
    if (!status.ok()) return named(status);
  }
  const BlinkFrequencies frequencies = BlinkFrequenciesOf(target, options.blink_hz);
  auto filter = BlinkFilter::Create(FilterOptions(options, camera, frequencies.hz));
  if (!filter.ok()) return named(filter.status());
  auto impl = std::make_unique<Impl>(options, target, camera, frequencies,
                                     MakeDecoder(format, halves_swapped, GeometryOf(camera)),
                                     *std::move(filter));
  return BlinkWandDetector(std::move(impl));
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
        StoppingConsumer consumer{timeline.BeginPass(), &timeline, timeline.NextStop()};
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

const EventFaults& BlinkWandDetector::faults() const {
  return std::visit([](const auto& decoder) -> const EventFaults& { return decoder.faults(); },
                    impl_->decoder);
}

const FaultPlaces& BlinkWandDetector::fault_places() const { return impl_->fault_locator.places(); }

const BlinkWandCounts& BlinkWandDetector::counts() const { return impl_->timeline.counts(); }

}  // namespace rigcal::agent
