// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/event_files/event_file_writer.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr size_t kBufferBytes = size_t{1} << 20;
constexpr size_t kMaxRunEvents = 4096;
constexpr uint8_t kChannels = 16;  // four bits
// TIME_HIGH words, as TimeHigh weighs them: it believes steps of up to kStep at once, longer ones
// of up to half a period once the next word confirms them, and takes a jump from below kTop to
// kStep or less for a restart.
constexpr int64_t kPeriod = 0x1000;
constexpr int64_t kStep = 16;
constexpr int64_t kJump = 0x700;
constexpr int64_t kTop = kPeriod - 1 - kStep;
// 12 days of overflows to count make half a megabyte.
constexpr int64_t kMaxClimb = int64_t{1} << 28;

int64_t High(int64_t time_us) { return time_us >> 12; }

}  // namespace

absl::StatusOr<std::unique_ptr<RawEventWriter>> RawEventWriter::Create(
    const std::string& path, const PlainFileFront& front) {
  if (!front.geometry) {
    return absl::InvalidArgumentError(
        "a RAW file needs the size of the sensor, and nothing tells it: add --geometry "
        "WIDTHxHEIGHT");
  }
  RIGCAL_ASSIGN_OR_RETURN(OutputFile file, OutputFile::Create(path));
  const auto serial = front.fields.find("serial_number");
  const std::string header =
      Evt3Header(*front.geometry, serial == front.fields.end() ? "unknown" : serial->second);
  RIGCAL_RETURN_IF_ERROR(
      file.Write({reinterpret_cast<const uint8_t*>(header.data()), header.size()}));
  return std::unique_ptr<RawEventWriter>(new RawEventWriter(path, std::move(file)));
}

void RawEventWriter::WriteHigh(int64_t high) {
  writer_.WriteTime(high * kPeriod, &words_);
  high_ = high;
}

absl::Status RawEventWriter::Climb(int64_t high) {
  if (high - *high_ > kMaxClimb) {
    return absl::FailedPreconditionError(
        absl::StrCat(path_, ": EVT 3.0 counts 16 s at a time and cannot tell a time of ",
                     high * kPeriod, " us; write HDF5 or CSV"));
  }
  while (high - *high_ > kStep) {
    int64_t next = std::min(high, *high_ + kJump);
    const bool looks_like_restart = next % kPeriod <= kStep && *high_ % kPeriod <= kTop;
    if (looks_like_restart && next / kPeriod != *high_ / kPeriod) {
      next = next / kPeriod * kPeriod - kStep / 2;
    }
    WriteHigh(next);
    if (next < high) WriteHigh(next + 1);
  }
  return absl::OkStatus();
}

void RawEventWriter::StepBack() {
  WriteHigh(*high_ + 1);  // confirms the last one: it may have been a jump
  // From where a jump to zero is taken for a restart.
  const int64_t value = *high_ % kPeriod;
  if (value <= kStep || value > kTop) {
    WriteHigh(*high_ + 4 * kStep);
    WriteHigh(*high_ + 1);
  }
  for (int i = 0; i < 2; ++i) {
    writer_ = Evt3Writer();
    WriteHigh(0);
  }
}

absl::Status RawEventWriter::GoTo(int64_t* time_us) {
  if (*time_us < 0) {
    return absl::FailedPreconditionError(absl::StrCat(
        path_, ": a sensor's time cannot be negative, as ", *time_us, " us is; write HDF5 or CSV"));
  }
  if (!high_) {
    WriteHigh(std::min(High(*time_us), kPeriod - 1));
    // A first word that a jump follows is confirmed, too.
    if (*high_ < High(*time_us)) WriteHigh(*high_ + 1);
  }
  int64_t high = High(*time_us);
  if (high < *high_) {
    if (*high_ * kPeriod - *time_us <= PlainClock::kJitterUs) {
      ++losses_.moved_events;
      *time_us = *high_ * kPeriod;
      return absl::OkStatus();
    }
    StepBack();
    high = High(*time_us);
  }
  RIGCAL_RETURN_IF_ERROR(Climb(high));
  high_ = high;
  return absl::OkStatus();
}

void RawEventWriter::WriteRun() {
  writer_.Write(run_, &words_);
  run_.clear();
}

absl::Status RawEventWriter::Write(std::span<const PlainEvent> events) {
  for (const PlainEvent& event : events) {
    if (event.kind >= PlainEvent::kUnreadable) continue;
    const bool is_trigger = event.kind >= PlainEvent::kTriggerFalling;
    if (is_trigger && event.channel >= kChannels) {
      ++losses_.triggers;
      continue;
    }
    int64_t time_us = event.time_us;
    if (!high_ || High(time_us) != *high_ || is_trigger || run_.size() >= kMaxRunEvents) {
      WriteRun();
      RIGCAL_RETURN_IF_ERROR(GoTo(&time_us));
    }
    if (is_trigger) {
      writer_.Write(TriggerEvent{.time_us = time_us,
                                 .channel = event.channel,
                                 .rising = event.kind == PlainEvent::kTriggerRising},
                    &words_);
    } else {
      run_.push_back(
          {.time_us = time_us, .x = event.x, .y = event.y, .on = event.kind == PlainEvent::kOn});
    }
    if (words_.size() < kBufferBytes) continue;
    RIGCAL_RETURN_IF_ERROR(file_.Write(words_));
    words_.clear();
  }
  return absl::OkStatus();
}

absl::Status RawEventWriter::Finish() {
  WriteRun();
  RIGCAL_RETURN_IF_ERROR(file_.Write(words_));
  return file_.Finish();
}

}  // namespace rigcal::agent
