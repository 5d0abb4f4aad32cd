// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/recorded/raw_event_source.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/capture/camera_status.h"
#include "agent/event_files/sensor_geometry.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr size_t kFastBytes = size_t{64} << 10;
constexpr size_t kPacedBytes = size_t{256} << 10;
constexpr size_t kTimedBytes = 512;
constexpr int64_t kPacedUs = 2000;

// Header, option and calibration must agree.
absl::StatusOr<SensorGeometry> ResolveGeometry(const EventFileHeader& header,
                                               const RawSourceOptions& options,
                                               const CameraDescription& calibrated) {
  struct Statement {
    std::string by;
    SensorGeometry geometry;
  };
  std::vector<Statement> said;
  if (header.geometry) {
    said.push_back({header.format == EventFormat::kPlain ? "its own statement" : "its header",
                    *header.geometry});
  }
  if (options.geometry) said.push_back({"geometry=", *options.geometry});
  if (calibrated.intrinsics) {
    said.push_back({absl::StrCat("the calibration ", options.calibration_path),
                    {calibrated.image_size_px.width, calibrated.image_size_px.height}});
  }
  if (said.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(options.path, " does not say the size of its sensor; add ;geometry=WxH"));
  }
  for (const Statement& other : said) {
    if (other.geometry == said.front().geometry) continue;
    return absl::InvalidArgumentError(
        absl::StrCat(options.path, ": the sensor has ", FormatSensorGeometry(said.front().geometry),
                     " pixels by ", said.front().by, ", but ", FormatSensorGeometry(other.geometry),
                     " by ", other.by, "; name the right one"));
  }
  return said.front().geometry;
}

}  // namespace

absl::StatusOr<std::unique_ptr<RawEventSource>> RawEventSource::Create(RawSourceOptions options) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  RIGCAL_ASSIGN_OR_RETURN(const auto file,
                          OfCamera(options.camera, OpenEventFile(options.path, options.plain)));
  RIGCAL_ASSIGN_OR_RETURN(CameraDescription description,
                          DescribeRecording("raw", options, SensorKind::kEvent));
  RIGCAL_ASSIGN_OR_RETURN(
      const SensorGeometry geometry,
      OfCamera(options.camera, ResolveGeometry(file->header(), options, description)));
  description.image_size_px = {geometry.width, geometry.height};
  if (!options.clock_id.empty()) description.clock.clock_id = options.clock_id;
  RIGCAL_RETURN_IF_ERROR(description.Validate());
  return std::make_unique<RawEventSource>(std::move(options), std::move(description));
}

absl::Status RawEventSource::Start(const Target&) {
  file_.reset();
  RIGCAL_ASSIGN_OR_RETURN(file_,
                          OfCamera(options_.camera, OpenEventFile(options_.path, options_.plain)));
  const SensorGeometry geometry{description_.image_size_px.width,
                                description_.image_size_px.height};
  timer_.emplace(
      MakeEventDecoder(file_->header().format, file_->header().halves_swapped, geometry));
  pacer_.Start();
  return absl::OkStatus();
}

absl::StatusOr<std::optional<EventChunk>> RawEventSource::Next() {
  if (!file_) return std::nullopt;
  EventChunk chunk{.format = file_->header().format,
                   .halves_swapped = file_->header().halves_swapped,
                   .bytes = {},
                   .byte_offset = file_->byte_offset()};
  if (options_.speed == kMaxSpeed) {
    if (!pacer_.Wait(0)) return std::nullopt;
    RIGCAL_ASSIGN_OR_RETURN(chunk.bytes, file_->Next(kFastBytes));
    if (chunk.bytes.empty()) return std::nullopt;
    return chunk;
  }
  piece_.clear();
  const int64_t begin_us = timer_->time_us();
  while (piece_.size() < kPacedBytes && timer_->time_us() - begin_us < kPacedUs &&
         timer_->time_us() >= begin_us) {
    RIGCAL_ASSIGN_OR_RETURN(const auto bytes, file_->Next(kTimedBytes));
    if (bytes.empty()) break;
    timer_->Take(bytes);
    piece_.insert(piece_.end(), bytes.begin(), bytes.end());
  }
  if (piece_.empty() || !pacer_.Wait(timer_->time_us() * 1000)) return std::nullopt;
  chunk.bytes = piece_;
  return chunk;
}

std::string RawEventSource::PlaceOf(uint64_t byte_offset) const {
  return absl::StrCat(options_.path, ", ",
                      file_ ? file_->PlaceOf(byte_offset) : EventSource::PlaceOf(byte_offset));
}

std::vector<Refusal> RawEventSource::Refused() const {
  return file_ ? file_->Refused() : std::vector<Refusal>();
}

}  // namespace rigcal::agent
