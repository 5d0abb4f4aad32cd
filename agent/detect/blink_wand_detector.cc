// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blink_wand_detector.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "agent/detect/blink_filter.h"
#include "agent/detect/blink_frequencies.h"
#include "agent/detect/blink_wand_judge.h"
#include "agent/event/event_decoder.h"
#include "agent/event/plain_events.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr double kWaitPeriods = 0.8;  // then the burst nearest to a time is over
constexpr double kHoldPeriods = 2;    // until then answers of triggers and rate may overtake
// What is asked of one Take: a marker of a few pixels tells each period in more bytes.
constexpr size_t kBytesPerAnswer = 8;
constexpr int64_t kLeastAnswers = 1000;
constexpr int64_t kSilencePeriods = 20;
constexpr size_t kBytesPerForget = 512;
constexpr int64_t kLeastForgets = 16;
constexpr int kMaxFits = 8000;  // a wall of lamps must not take longer than a sensor waits
constexpr int64_t kSweepPeriods = 2;

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
       BlinkFilter filter_in)
      : decoder(decoder_in),
        filter(std::move(filter_in)),
        judge(FinderOptions(options, frequencies), options.min_confidence, target, camera),
        period_us(filter.period_us()),
        marker_count(static_cast<size_t>(target.marker_count())),
        sweep_us(static_cast<int64_t>(static_cast<double>(kSweepPeriods) * period_us)),
        silence_us(std::min(OutputSchedule::kMaxGapUs, kSilencePeriods * sweep_us / kSweepPeriods)),
        schedule(options.output, std::llround(kWaitPeriods * period_us)) {
    for (const int index : frequencies.of_marker) {
      marker_period_us.push_back(1e6 / frequencies.hz[static_cast<size_t>(index)]);
    }
  }

  // Called while decoding; each returns when to be called next.
  uint32_t Reach(uint32_t time_us);
  uint32_t TakeTrigger(const TriggerEvent& trigger);
  uint32_t StepBack(int64_t time_us);

  void BeginTake(size_t byte_count);
  void EndTake();
  // All pixels, which takes as long as many events; while the clock jumps all the time it is put
  // off to the end of a Take, and no blob is seen until then.
  void Forget(int64_t time_us);
  void AdvanceTo(int64_t time_us);
  void Run(int64_t time_us);
  void Begin(int64_t time_us);
  void Answer(const OutputTime& asked);
  bool SetTimes(const OutputTime& asked, const BlinkWand& wand, Observation* observation);
  void Release(int64_t before_ns);
  uint32_t NextStop() const {
    return static_cast<uint32_t>(std::min(next_sweep_us, schedule.due_us()));
  }

  Decoder decoder;
  FaultFinder fault_finder;
  BlinkFilter filter;
  BlinkWandJudge judge;
  const double period_us;  // the longest
  absl::InlinedVector<double, 3> marker_period_us;
  const size_t marker_count;
  const int64_t sweep_us;
  const int64_t silence_us;  // after which no pixel blinks any more
  OutputSchedule schedule;
  BlinkWandCounts counts;

  bool begun = false;
  uint32_t clock_epoch = 0;
  int64_t reached_us = 0;
  int64_t next_sweep_us = 0;
  int64_t answers_left = 0;  // at the fixed rate, in this Take
  int64_t forgets_left = 0;
  bool is_clear = true;  // no event has come to the filter since it forgot all
  // The filter holds what is no longer so.
  bool must_forget = false;
  absl::InlinedVector<double, 3> last_burst_us;  // by marker; empty: none yet
  std::optional<int64_t> last_told_ns;
  std::vector<Detection> held;  // by time
  std::vector<Detection>* found = nullptr;
};

namespace {

// Feeds the filter, stopped whenever something is due.
template <typename Impl>
struct StoppingConsumer {
  BlinkFilter::Pass pass;
  Impl* impl;
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
      Feed(events.first(next));
      stop_us = impl->Reach(events[next].time_us);
      Feed(events.subspan(next, 1));
      events = events.subspan(next + 1);
    }
    Feed(events);
  }
  void Feed(std::span<const PackedEvent> events) {
    if (events.empty()) return;
    impl->is_clear = false;
    pass.Events(events);
  }
  void Trigger(const TriggerEvent& trigger) { stop_us = impl->TakeTrigger(trigger); }
  void TimeStepBack(int64_t time_us) { stop_us = impl->StepBack(time_us); }
};

struct FirstTimeSink {
  std::optional<uint32_t> first_us;

  void Row(uint32_t) {}
  void Event(uint32_t, uint32_t, bool, uint32_t time_us) { Take(time_us); }
  void Vector(uint32_t, uint32_t, bool, uint32_t time_us, uint32_t) { Take(time_us); }
  void Trigger(const TriggerEvent& trigger) { Take(static_cast<uint32_t>(trigger.time_us)); }
  void TimeStepBack(int64_t) { first_us.reset(); }
  void Take(uint32_t time_us) {
    if (!first_us) first_us = time_us;
  }
};

// Of the first event in these bytes.
template <typename Decoder>
std::optional<int64_t> FirstTime(Decoder decoder, std::span<const uint8_t> bytes) {
  FirstTimeSink sink;
  decoder.Decode(bytes, sink);
  if (!sink.first_us) return std::nullopt;
  const auto last_us = static_cast<uint32_t>(decoder.time_us());
  return decoder.time_us() + static_cast<int32_t>(*sink.first_us - last_us);
}

// TIME_HIGH alone: the lower bits may still be those of the one before.
int64_t SafeTime(const Evt3Decoder& decoder) { return decoder.time_us() & ~int64_t{0xfff}; }
int64_t SafeTime(const Evt21Decoder& decoder) { return decoder.time_us(); }
int64_t SafeTime(const Evt2Decoder& decoder) { return decoder.time_us(); }
int64_t SafeTime(const PlainEventDecoder& decoder) { return decoder.time_us(); }

}  // namespace

void BlinkWandDetector::Impl::Begin(int64_t time_us) {
  begun = true;
  reached_us = time_us;
  next_sweep_us = time_us + sweep_us;
  schedule.Start(time_us);
}

uint32_t BlinkWandDetector::Impl::Reach(uint32_t time_us) {
  const auto reached = static_cast<uint32_t>(reached_us);
  AdvanceTo(reached_us + static_cast<int32_t>(time_us - reached));
  return NextStop();
}

uint32_t BlinkWandDetector::Impl::TakeTrigger(const TriggerEvent& trigger) {
  AdvanceTo(trigger.time_us);
  schedule.Take(trigger);
  return NextStop();
}

uint32_t BlinkWandDetector::Impl::StepBack(int64_t time_us) {
  Release(std::numeric_limits<int64_t>::max());
  Forget(time_us);
  last_burst_us.clear();
  last_told_ns.reset();
  ++clock_epoch;
  Begin(time_us);
  return NextStop();
}

void BlinkWandDetector::Impl::BeginTake(size_t byte_count) {
  answers_left = kLeastAnswers + static_cast<int64_t>(byte_count / kBytesPerAnswer);
  forgets_left = kLeastForgets + static_cast<int64_t>(byte_count / kBytesPerForget);
}

void BlinkWandDetector::Impl::EndTake() {
  if (!std::exchange(must_forget, false)) return;
  is_clear = true;
  filter.TimeStepBack(reached_us);
}

void BlinkWandDetector::Impl::Forget(int64_t time_us) {
  if (is_clear) return;
  must_forget = forgets_left == 0;
  if (must_forget) return;
  --forgets_left;
  is_clear = true;
  filter.TimeStepBack(time_us);
}

void BlinkWandDetector::Impl::AdvanceTo(int64_t time_us) {
  if (!begun) Begin(time_us);
  if (time_us - reached_us > silence_us) {
    // What was asked before is still answered, the rest without a look at every pixel's age.
    Run(reached_us + static_cast<int64_t>(2 * kHoldPeriods * period_us));
    schedule.Skip(reached_us, time_us);
    Forget(time_us);
    next_sweep_us = time_us + sweep_us;
  }
  Run(time_us);
  reached_us = std::max(reached_us, time_us);
}

void BlinkWandDetector::Impl::Run(int64_t time_us) {
  while (true) {
    const int64_t due_us = schedule.due_us();
    if (std::min(due_us, next_sweep_us) > time_us) return;
    if (due_us <= next_sweep_us) {
      const OutputTime asked = schedule.Pop();
      if (asked.trigger || answers_left > 0) {
        Answer(asked);
        --answers_left;
      } else {
        ++counts.beyond_data;
      }
    } else {
      if (!must_forget && !is_clear) filter.Sweep(static_cast<uint32_t>(next_sweep_us));
      next_sweep_us += sweep_us;
    }
  }
}

bool BlinkWandDetector::Impl::SetTimes(const OutputTime& asked, const BlinkWand& wand,
                                       Observation* observation) {
  constexpr double kWrapUs = 4294967296.0;
  const auto due = static_cast<double>(static_cast<uint32_t>(asked.due_us));
  absl::InlinedVector<double, 3> since_asked_us;
  double mean_us = 0;
  for (const double time_us : wand.times_us) {
    since_asked_us.push_back(std::remainder(time_us - due, kWrapUs) +
                             static_cast<double>(asked.due_us - asked.time_us));
    mean_us += since_asked_us.back() / static_cast<double>(wand.times_us.size());
  }
  const bool first = last_burst_us.empty();
  if (first) last_burst_us.resize(since_asked_us.size());
  if (!asked.trigger) {
    for (size_t k = 0; k < since_asked_us.size() && !first; ++k) {
      const double burst_us = static_cast<double>(asked.time_us) + since_asked_us[k];
      if (burst_us < last_burst_us[k] + 0.5 * marker_period_us[k]) return false;
    }
    observation->time_ns = asked.time_us * 1000 + std::llround(mean_us * 1e3);
  }
  for (size_t k = 0; k < since_asked_us.size(); ++k) {
    const double burst_us = static_cast<double>(asked.time_us) + since_asked_us[k];
    last_burst_us[k] = first ? burst_us : std::max(last_burst_us[k], burst_us);
  }
  const int64_t shift_ns = observation->time_ns - asked.time_us * 1000;
  for (size_t k = 0; k < observation->markers.size(); ++k) {
    observation->markers[k].time_delta_ns =
        static_cast<int32_t>(std::llround(since_asked_us[k] * 1e3) - shift_ns);
  }
  return true;
}

void BlinkWandDetector::Impl::Answer(const OutputTime& asked) {
  static const std::vector<BlinkBlob> kNone;
  const auto due_us = static_cast<uint32_t>(asked.due_us);
  BlinkWand wand = judge.Judge(must_forget ? kNone : filter.FindBlobs(due_us));
  Detection detection;
  detection.outcome = wand.outcome;
  detection.confidence = wand.confidence;
  detection.blob_count = wand.blob_count;
  Observation& observation = detection.observation;
  observation.time_ns = asked.time_us * 1000;
  observation.clock_epoch = clock_epoch;
  if (wand.outcome == DetectionOutcome::kWand) {
    observation.markers = std::move(wand.markers);
    detection.covered_markers = static_cast<int>(marker_count) - observation.VisibleCount();
    if (!SetTimes(asked, wand, &observation)) {
      ++counts.same_burst;
      return;
    }
  } else {
    observation.markers.resize(marker_count);
  }
  const auto after = std::upper_bound(
      held.begin(), held.end(), observation.time_ns,
      [](int64_t time_ns, const Detection& other) { return time_ns < other.observation.time_ns; });
  held.insert(after, std::move(detection));
  Release((asked.due_us - static_cast<int64_t>(kHoldPeriods * period_us)) * 1000);
}

void BlinkWandDetector::Impl::Release(int64_t before_ns) {
  size_t count = 0;
  for (; count < held.size() && held[count].observation.time_ns < before_ns; ++count) {
    Detection& detection = held[count];
    if (last_told_ns && detection.observation.time_ns <= *last_told_ns) {
      ++counts.out_of_order;
      continue;
    }
    last_told_ns = detection.observation.time_ns;
    counts.by_outcome.Add(detection.outcome);
    found->push_back(std::move(detection));
  }
  held.erase(held.begin(), held.begin() + static_cast<std::ptrdiff_t>(count));
}

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
  impl->fault_finder = FaultFinder(halves_swapped);
  return BlinkWandDetector(std::move(impl));
}

void BlinkWandDetector::Take(std::span<const uint8_t> bytes, std::vector<Detection>* found) {
  impl_->found = found;
  impl_->BeginTake(bytes.size());
  std::visit(
      [&](auto& decoder) {
        if (!impl_->begun) {
          const std::optional<int64_t> first_us = FirstTime(decoder, bytes);
          if (first_us) impl_->Begin(*first_us);
        }
        const auto before = decoder;
        StoppingConsumer<Impl> consumer{impl_->filter.BeginPass(), impl_.get(), impl_->NextStop()};
        DecodeInBatches(decoder, bytes, consumer);
        impl_->fault_finder.Look(before, bytes, decoder.faults());
        if (impl_->begun) impl_->AdvanceTo(SafeTime(decoder));
      },
      impl_->decoder);
  impl_->EndTake();
  impl_->counts.dense_triggers = impl_->schedule.dense_triggers();
}

void BlinkWandDetector::Finish(std::vector<Detection>* found) {
  impl_->found = found;
  impl_->BeginTake(0);
  if (impl_->begun) {
    // Of the last event, however the stream was cut.
    impl_->AdvanceTo(
        std::visit([](const auto& decoder) { return decoder.time_us(); }, impl_->decoder));
    impl_->Run(impl_->reached_us + static_cast<int64_t>(kWaitPeriods * impl_->period_us));
  }
  impl_->Release(std::numeric_limits<int64_t>::max());
}

const EventFaults& BlinkWandDetector::faults() const {
  return std::visit([](const auto& decoder) -> const EventFaults& { return decoder.faults(); },
                    impl_->decoder);
}

const FaultPlaces& BlinkWandDetector::fault_places() const { return impl_->fault_finder.places(); }

const BlinkWandCounts& BlinkWandDetector::counts() const { return impl_->counts; }

}  // namespace rigcal::agent
