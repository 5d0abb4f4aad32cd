// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/event_file_info.h"

#include <algorithm>
#include <bit>
#include <filesystem>

#include "agent/event/any_event_decoder.h"
#include "agent/event/event_gaps.h"
#include "agent/event/fault_locator.h"
#include "agent/event_files/sensor_geometry.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// A wand's blink period, and silence that is no gap any more but a dark scene.
constexpr double kUsualPeriodUs = 2000;
constexpr int64_t kLongestGapUs = 40'000;
constexpr size_t kInfoPieceBytes = size_t{64} << 10;

// Counts. Times of CD events are 32 bits; the decoder's own time leads to all 64.
template <typename Decoder>
class InfoSink {
 public:
  InfoSink(const Decoder* decoder, EventFileInfo* info) : decoder_(*decoder), info_(*info) {}

  void Event(uint32_t x, uint32_t y, bool on, uint32_t time_us) { Vector(x, y, on, time_us, 1); }
  void Vector(uint32_t x, uint32_t y, bool on, uint32_t time_us, uint32_t mask) {
    const auto count = static_cast<uint64_t>(std::popcount(mask));
    info_.cd_events += count;
    info_.on_events += on ? count : 0;
    info_.sum_y += y * count;
    info_.largest_y = std::max(info_.largest_y, y);
    const auto last = 31 - static_cast<uint32_t>(std::countl_zero(mask));
    info_.largest_x = std::max(info_.largest_x, x + last);
    for (; mask != 0; mask &= mask - 1) {
      info_.sum_x += x + static_cast<uint32_t>(std::countr_zero(mask));
    }
    const PackedEvent event{.time_us = time_us, .x = 0, .y_polarity = 0};
    const std::span<const PackedEvent> one(&event, 1);
    if (gaps_.MayHold(one)) {
      gaps_.Next(one);
    } else {
      gaps_.Pass(one);
    }
    const int64_t near_us = decoder_.time_us();
    See(near_us + static_cast<int32_t>(time_us - static_cast<uint32_t>(near_us)));
  }
  void Trigger(const TriggerEvent& trigger) {
    ++info_.trigger_events;
    TriggerEdges& edges = (trigger.rising ? info_.rising : info_.falling)[trigger.channel];
    if (edges.count++ == 0) {
      edges.first_us = trigger.time_us;
    } else if (trigger.time_us > edges.last_us) {
      const int64_t gap_us = trigger.time_us - edges.last_us;
      edges.shortest_gap_us =
          edges.shortest_gap_us == 0 ? gap_us : std::min(edges.shortest_gap_us, gap_us);
      edges.longest_gap_us = std::max(edges.longest_gap_us, gap_us);
    }
    edges.last_us = trigger.time_us;
    See(trigger.time_us);
  }
  void TimeStepBack(int64_t time_us) {
    EndEpoch();
    gaps_.Restart();
    now_us_ = time_us;
  }

  void EndEpoch() {
    if (in_epoch_) info_.duration_us += now_us_ - epoch_first_us_;
    in_epoch_ = false;
    info_.gaps = gaps_.count();
    info_.gap_us = gaps_.total_us();
  }

 private:
  void See(int64_t time_us) {
    if (!info_.first_us) info_.first_us = time_us;
    if (!in_epoch_) epoch_first_us_ = now_us_ = time_us;
    if (in_epoch_ && time_us > now_us_) {
      const int64_t step_us = time_us - now_us_;
      if (info_.step_count++ == 0 || step_us < info_.shortest_step_us) {
        info_.shortest_step_us = step_us;
      }
    }
    in_epoch_ = true;
    now_us_ = std::max(now_us_, time_us);
    info_.last_us = now_us_;
  }

  const Decoder& decoder_;
  EventFileInfo& info_;
  EventGaps gaps_{kUsualPeriodUs, kLongestGapUs};
  int64_t now_us_ = 0;
  bool in_epoch_ = false;
  int64_t epoch_first_us_ = 0;
};

// The smallest sensor that has all pixels of a file.
struct ExtentSink {
  SensorGeometry extent;

  void Event(uint32_t x, uint32_t y, bool, uint32_t) {
    extent.width = std::max(extent.width, x + 1);
    extent.height = std::max(extent.height, y + 1);
  }
  void Vector(uint32_t x, uint32_t y, bool on, uint32_t time_us, uint32_t mask) {
    Event(x + 31 - static_cast<uint32_t>(std::countl_zero(mask)), y, on, time_us);
  }
  void Trigger(const TriggerEvent&) {}
  void TimeStepBack(int64_t) {}
};

template <typename Decoder>
absl::Status CountAll(Decoder decoder, EventFile* file, const EventsRead& on_read,
                      EventFileInfo* info) {
  InfoSink sink(&decoder, info);
  FaultLocator locator;
  const uint64_t begin = file->byte_offset();
  while (true) {
    RIGCAL_ASSIGN_OR_RETURN(const auto bytes, file->Next(kInfoPieceBytes));
    if (bytes.empty()) break;
    const Decoder before = decoder;
    decoder.Decode(bytes, sink);
    locator.Look(before, bytes, decoder.faults());
    for (const auto& [name, offset] : locator.places()) {
      info->first_faults.try_emplace(name, file->PlaceOf(begin + offset));
    }
    if (on_read) on_read(info->cd_events);
  }
  sink.EndEpoch();
  info->faults = decoder.faults();
  info->refused = file->Refused();
  return absl::OkStatus();
}

template <typename Decoder>
absl::Status FindExtent(Decoder decoder, EventFile* file, EventFileInfo* info) {
  ExtentSink sink;
  while (true) {
    RIGCAL_ASSIGN_OR_RETURN(const auto bytes, file->Next(kInfoPieceBytes));
    if (bytes.empty()) break;
    decoder.Decode(bytes, sink);
  }
  info->extent = sink.extent;
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<EventFileInfo> ReadEventFileInfo(const std::string& path,
                                                std::optional<SensorGeometry> geometry,
                                                const EventFileOptions& plain,
                                                const EventsRead& on_read) {
  RIGCAL_ASSIGN_OR_RETURN(const auto file, OpenEventFile(path, plain));
  EventFileInfo info;
  info.path = path;
  std::error_code ignored;
  info.byte_count = std::filesystem::file_size(path, ignored);
  info.header = file->header();
  const auto decoder_of = [&header = info.header](SensorGeometry all) {
    return MakeEventDecoder(header.format, header.halves_swapped, all);
  };
  RIGCAL_ASSIGN_OR_RETURN(const auto known, GeometryOf(path, info.header, geometry));
  RIGCAL_RETURN_IF_ERROR(
      std::visit([&](const auto& decoder) { return CountAll(decoder, file.get(), on_read, &info); },
                 decoder_of(known.value_or(EveryPixel(EventFormat::kEvt3)))));
  if (info.faults.outside_geometry == 0) return info;
  RIGCAL_ASSIGN_OR_RETURN(const auto again, OpenEventFile(path, plain));
  RIGCAL_RETURN_IF_ERROR(
      std::visit([&](const auto& decoder) { return FindExtent(decoder, again.get(), &info); },
                 decoder_of(EveryPixel(info.header.format))));
  return info;
}

}  // namespace rigcal::agent
