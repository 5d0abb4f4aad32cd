// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/event_conversion.h"

#include <unistd.h>

#include <bit>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "agent/event/any_event_decoder.h"
#include "agent/event_files/sensor_geometry.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr size_t kPieceBytes = size_t{256} << 10;

// Collects events with their whole times.
template <typename Decoder>
struct PlainSink {
  const Decoder& decoder;
  std::vector<PlainEvent> events;
  uint64_t trigger_events = 0;

  void Event(uint32_t x, uint32_t y, bool on, uint32_t time_us) {
    // Times of CD events are 32 bits; the decoder's own time leads to all 64.
    const int64_t near_us = decoder.time_us();
    events.push_back(
        {.time_us = near_us + static_cast<int32_t>(time_us - static_cast<uint32_t>(near_us)),
         .x = static_cast<uint16_t>(x),
         .y = static_cast<uint16_t>(y),
         .kind = on ? PlainEvent::kOn : PlainEvent::kOff});
  }
  void Vector(uint32_t x, uint32_t y, bool on, uint32_t time_us, uint32_t mask) {
    for (; mask != 0; mask &= mask - 1) {
      Event(x + static_cast<uint32_t>(std::countr_zero(mask)), y, on, time_us);
    }
  }
  void Trigger(const TriggerEvent& trigger) {
    ++trigger_events;
    events.push_back(
        {.time_us = trigger.time_us,
         .kind = trigger.rising ? PlainEvent::kTriggerRising : PlainEvent::kTriggerFalling,
         .channel = trigger.channel});
  }
  void TimeStepBack(int64_t) {}
};

template <typename Decoder>
absl::Status CopyAll(Decoder decoder, EventFile* file, PlainEventWriter* writer,
                     const EventsRead& on_read, ConversionSummary* summary) {
  PlainSink<Decoder> sink{decoder, {}, 0};
  while (true) {
    RIGCAL_ASSIGN_OR_RETURN(const auto bytes, file->Next(kPieceBytes));
    if (bytes.empty()) break;
    sink.events.clear();
    decoder.Decode(bytes, sink);
    summary->cd_events += sink.events.size();
    RIGCAL_RETURN_IF_ERROR(writer->Write(sink.events));
    if (on_read) on_read(summary->cd_events);
  }
  summary->trigger_events = sink.trigger_events;
  summary->cd_events -= sink.trigger_events;
  summary->faults = decoder.faults();
  summary->refused = file->Refused();
  return absl::OkStatus();
}

// The fields of a file's header that are also true of the new file.
std::map<std::string, std::string> Fields(const EventFileHeader& header) {
  std::map<std::string, std::string> fields = header.fields;
  for (const char* const about_the_file :
       {"end", "evt", "format", "geometry", "width", "height", "sensor_resolution", "t_offset"}) {
    fields.erase(about_the_file);
  }
  return fields;
}

}  // namespace

absl::StatusOr<ConversionSummary> ConvertEventFile(const ConversionOptions& options) {
  const std::filesystem::path out(options.out);
  std::error_code ignored;
  if (!options.force && std::filesystem::exists(out, ignored)) {
    return absl::AlreadyExistsError(
        absl::StrCat(options.out, " exists; add --force to replace it"));
  }
  if (std::filesystem::equivalent(options.in, out, ignored)) {
    return InvalidFile(options.out, " is the input file; name another one");
  }
  RIGCAL_ASSIGN_OR_RETURN(const auto file, OpenEventFile(options.in, options.plain));
  RIGCAL_ASSIGN_OR_RETURN(const auto geometry,
                          GeometryOf(options.in, file->header(), options.geometry));
  const EventFileHeader& header = file->header();
  const std::string part = absl::StrCat(options.out, ".part", ::getpid());
  const absl::Cleanup remove = [&part] { std::remove(part.c_str()); };  // unless it has its name
  const std::string ending = absl::AsciiStrToLower(out.extension().string());
  RIGCAL_ASSIGN_OR_RETURN(
      const auto writer,
      CreateEventFileWriter(part, ending, {.geometry = geometry, .fields = Fields(header)},
                            options.layout, options.raw));
  ConversionSummary summary;
  RIGCAL_RETURN_IF_ERROR(std::visit(
      [&](const auto& decoder) {
        return CopyAll(decoder, file.get(), writer.get(), options.on_read, &summary);
      },
      MakeEventDecoder(header.format, header.halves_swapped,
                       geometry.value_or(EveryPixel(header.format)))));
  RIGCAL_RETURN_IF_ERROR(writer->Finish());
  summary.losses = writer->losses();
  if (std::rename(part.c_str(), options.out.c_str()) != 0) {
    return absl::FailedPreconditionError(
        absl::StrCat("cannot make ", options.out, ": ", std::strerror(errno)));
  }
  return summary;
}

}  // namespace rigcal::agent
