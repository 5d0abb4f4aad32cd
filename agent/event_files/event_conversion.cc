// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/event_conversion.h"

#include <unistd.h>

#include <bit>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "agent/event_files/event_file.h"
#include "agent/event_files/event_file_writer.h"
#include "agent/event_files/sensor_geometry.h"
#include "agent/event_files/with_decoder.h"
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
                     ConversionSummary* summary) {
  PlainSink<Decoder> sink{decoder, {}, 0};
  while (true) {
    RIGCAL_ASSIGN_OR_RETURN(const auto bytes, file->Next(kPieceBytes));
    if (bytes.empty()) break;
    sink.events.clear();
    decoder.Decode(bytes, sink);
    summary->cd_events += sink.events.size();
    RIGCAL_RETURN_IF_ERROR(writer->Write(sink.events));
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

// A file that appears under its name once it is complete.
class NewFile {
 public:
  explicit NewFile(std::string path)
      : path_(std::move(path)), part_(absl::StrCat(path_, ".part", ::getpid())) {}
  ~NewFile() {
    if (!is_complete_) std::remove(part_.c_str());
  }
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  const std::string& part() const { return part_; }
  absl::Status Appear() {
    if (std::rename(part_.c_str(), path_.c_str()) != 0) {
      return absl::FailedPreconditionError(
          absl::StrCat("cannot make ", path_, ": ", std::strerror(errno)));
    }
    is_complete_ = true;
    return absl::OkStatus();
  }

 private:
  const std::string path_;
  const std::string part_;
  bool is_complete_ = false;
};

}  // namespace

absl::StatusOr<ConversionSummary> ConvertEventFile(const ConversionOptions& options) {
  const std::filesystem::path out(options.out);
  std::error_code ignored;
  if (!options.force && std::filesystem::exists(out, ignored)) {
    return absl::AlreadyExistsError(
        absl::StrCat(options.out, " exists; add --force to replace it"));
  }
  if (std::filesystem::equivalent(options.in, out, ignored)) {
    return absl::InvalidArgumentError(
        absl::StrCat(options.out, " is the input file; name another one"));
  }
  RIGCAL_ASSIGN_OR_RETURN(const auto file, OpenEventFile(options.in, options.plain));
  RIGCAL_ASSIGN_OR_RETURN(const auto geometry,
                          GeometryOf(options.in, file->header(), options.geometry));
  NewFile new_file(options.out);
  const std::string ending = absl::AsciiStrToLower(out.extension().string());
  RIGCAL_ASSIGN_OR_RETURN(
      const auto writer,
      CreateEventFileWriter(new_file.part(), ending,
                            {.geometry = geometry, .fields = Fields(file->header())},
                            options.layout));
  const SensorGeometry every =
      file->header().format == EventFormat::kPlain ? kWholePlainSensor : kWholeSensor;
  ConversionSummary summary;
  RIGCAL_RETURN_IF_ERROR(WithDecoder(file->header(), geometry.value_or(every), [&](auto decoder) {
    return CopyAll(std::move(decoder), file.get(), writer.get(), &summary);
  }));
  RIGCAL_RETURN_IF_ERROR(writer->Finish());
  summary.losses = writer->losses();
  RIGCAL_RETURN_IF_ERROR(new_file.Appear());
  return summary;
}

}  // namespace rigcal::agent
