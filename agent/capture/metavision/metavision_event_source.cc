// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/metavision/metavision_event_source.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "agent/capture/camera_status.h"
#include "common/import/intrinsics_file.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr size_t kLongestPiece = size_t{1} << 20;  // whole words of every format
constexpr std::chrono::milliseconds kPoll(1);
constexpr std::chrono::seconds kSilence(5);

absl::StatusOr<MetavisionRequest> MakeRequest(const MetavisionSourceOptions& options) {
  MetavisionRequest request{.camera = options.camera,
                            .serial = options.serial,
                            .config = {},
                            .trigger_channel = options.trigger_channel};
  if (!options.settings_path.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(request.config,
                            OfCamera(options.camera, ReadEventCameraConfig(options.settings_path)));
  }
  if (options.sync) request.config.sync = options.sync;
  if (options.uses_triggers && request.config.trigger_in.empty()) {
    request.config.trigger_in = {"main"};
  }
  if (request.config.sync == EventCameraSync::kSecondary && options.clock_id.empty()) {
    spdlog::warn(
        "camera {}: it follows the clock of another camera, but is taken for one with its own; "
        "give all cameras on the cable the same name with ;clock=NAME",
        options.camera);
  }
  return request;
}

CameraSettings SettingsOf(const MetavisionIdentity& identity) {
  CameraSettings settings;
  settings.model = absl::StrCat(identity.model, " ", identity.serial);
  settings.pixel_format = identity.format_name;
  settings.trigger =
      identity.trigger_inputs.empty() ? "free" : absl::StrJoin(identity.trigger_inputs, ", ");
  return settings;
}

absl::StatusOr<CameraDescription> Describe(const MetavisionSourceOptions& options,
                                           const MetavisionIdentity& identity) {
  CameraDescription description;
  description.camera = options.camera;
  description.image_size_px = {identity.geometry.width, identity.geometry.height};
  if (!options.calibration_path.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(
        IntrinsicsFile calibration,
        OfCamera(options.camera, ReadIntrinsicsFile(options.calibration_path, options.camera)));
    const ImageSize calibrated_px = calibration.image_size_px;
    if (calibrated_px != description.image_size_px) {
      return absl::FailedPreconditionError(absl::StrCat(
          "camera ", options.camera, ": the sensor has ", identity.geometry.width, "x",
          identity.geometry.height, " pixels, but ", options.calibration_path, " is for ",
          calibrated_px.width, "x", calibrated_px.height, "; name the camera's own calibration"));
    }
    description.intrinsics = std::move(calibration.intrinsics);
  }
  description.clock = {.clock_id = options.clock_id.empty() ? options.camera : options.clock_id,
                       .timebase = ""};
  description.latency_s = options.latency_s;
  description.sensor = SensorKind::kEvent;
  description.source = absl::StrCat("metavision:", identity.serial);
  description.settings = SettingsOf(identity);
  RIGCAL_RETURN_IF_ERROR(description.Validate());
  return description;
}

}  // namespace

absl::StatusOr<std::unique_ptr<MetavisionEventSource>> MetavisionEventSource::Create(
    MetavisionSourceOptions options) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  RIGCAL_ASSIGN_OR_RETURN(MetavisionRequest request, MakeRequest(options));
  RIGCAL_ASSIGN_OR_RETURN(std::unique_ptr<MetavisionDevice> device, OpenMetavisionDevice(request));
  RIGCAL_ASSIGN_OR_RETURN(CameraDescription description, Describe(options, device->identity()));
  // If it is lost, only the same camera may replace it.
  request.serial = device->identity().opened_as;
  return std::unique_ptr<MetavisionEventSource>(new MetavisionEventSource(
      std::move(options), std::move(request), std::move(description), std::move(device)));
}

MetavisionEventSource::MetavisionEventSource(MetavisionSourceOptions options,
                                             MetavisionRequest request,
                                             CameraDescription description,
                                             std::unique_ptr<MetavisionDevice> device)
    : options_(std::move(options)),
      request_(std::move(request)),
      description_(std::move(description)),
      device_(std::move(device)),
      identity_(device_->identity()) {}

MetavisionEventSource::~MetavisionEventSource() { EndStream(); }

absl::Status MetavisionEventSource::Start(const Target&) {
  EndStream();
  refused_ = RefusalCounter();
  byte_offset_ = 0;
  clock_began_anew_ = false;
  pause_ = options_.shortest_pause;
  begins_at_ = SteadyClock::now();
  if (request_.config.sync == EventCameraSync::kPrimary) {
    begins_at_ += std::chrono::duration_cast<SteadyClock::duration>(
        std::chrono::duration<double>(options_.primary_delay_s));
  }
  stopped_ = false;
  return absl::OkStatus();
}

void MetavisionEventSource::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
  }
  stop_changed_.notify_all();
}

bool MetavisionEventSource::WaitUntil(SteadyTime deadline) {
  std::unique_lock lock(mutex_);
  return !stop_changed_.wait_until(lock, deadline, [this] { return stopped_.load(); });
}

absl::StatusOr<std::optional<EventChunk>> MetavisionEventSource::Next() {
  if (arrival_) {
    // Only now: samples taken before belong to the epoch of the previous piece.
    clock_.EpochOf(arrival_->device_ns, *arrival_);
    clock_.AddArrival(*arrival_);
    arrival_.reset();
  }
  while (!stopped_) {
    if (!pending_.empty()) return TakePiece();
    if (!streaming_) {
      BeginStream();
      continue;
    }
    // The SDK's own wait could only be ended by a stop, which invalidates the last bytes.
    const absl::StatusOr<std::span<const uint8_t>> bytes = device_->Read();
    if (!bytes.ok()) {
      Lose(bytes.status());
    } else if (bytes->empty()) {
      WarnOfSilence();
      WaitUntil(SteadyClock::now() + kPoll);
    } else {
      TakeBytes(*bytes);
    }
  }
  EndStream();
  return std::nullopt;
}

void MetavisionEventSource::BeginStream() {
  if (!device_) {
    if (!WaitUntil(SteadyClock::now() + pause_)) return;
    pause_ = NextPause(pause_, options_);
    if (const absl::Status status = OpenAgain(); !status.ok()) {
      std::string reason(status.message());
      if (reason != logged_reason_) spdlog::info("camera {}: not yet: {}", options_.camera, reason);
      logged_reason_ = std::move(reason);
      return;
    }
    logged_reason_.clear();
    spdlog::info("camera {}: {} is back", options_.camera, identity_.serial);
  }
  if (!WaitUntil(begins_at_)) return;
  joiner_.emplace(WordBytes(identity_.format));
  timer_.emplace(MakeEventDecoder(identity_.format, identity_.halves_swapped, identity_.geometry));
  last_time_us_ = 0;
  clock_ = DeviceClock();
  if (const absl::Status status = device_->Start(); !status.ok()) return Lose(status);
  streaming_ = true;
  silent_since_ = SteadyClock::now();
  silence_is_logged_ = false;
}

absl::Status MetavisionEventSource::OpenAgain() {
  RIGCAL_ASSIGN_OR_RETURN(std::unique_ptr<MetavisionDevice> device, OpenMetavisionDevice(request_));
  // It must match the description.
  const MetavisionIdentity& now = device->identity();
  if (now.geometry != identity_.geometry || now.serial != identity_.serial) {
    return absl::FailedPreconditionError(
        absl::StrCat("another camera answers: ", now.serial, " with ", now.geometry.width, "x",
                     now.geometry.height, " pixels instead of ", identity_.serial, " with ",
                     identity_.geometry.width, "x", identity_.geometry.height));
  }
  identity_ = now;
  device_ = std::move(device);
  return absl::OkStatus();
}

void MetavisionEventSource::Lose(const absl::Status& why) {
  const std::string reason(why.message());
  spdlog::warn("camera {}: {} was lost ({}); looking for it until it is back", options_.camera,
               identity_.serial, reason);
  refused_.Add("", RefusalReason::kCameraLost, 1, reason);
  EndStream();
  device_.reset();
  clock_began_anew_ = true;
}

void MetavisionEventSource::EndStream() {
  if (streaming_) device_->Stop();
  streaming_ = false;
  pending_ = {};
  arrival_.reset();
}

std::chrono::milliseconds MetavisionEventSource::NextPause(std::chrono::milliseconds pause,
                                                           const MetavisionSourceOptions& options) {
  return pause > options.longest_pause / 2 ? options.longest_pause : 2 * pause;
}

void MetavisionEventSource::TakeBytes(std::span<const uint8_t> bytes) {
  pending_ = joiner_->Join(bytes);
  pause_ = options_.shortest_pause;
  silence_is_logged_ = true;
}

EventChunk MetavisionEventSource::TakePiece() {
  const EventChunk chunk{.format = identity_.format,
                         .halves_swapped = identity_.halves_swapped,
                         .bytes = pending_.first(std::min(pending_.size(), kLongestPiece)),
                         .byte_offset = byte_offset_,
                         .clock_began_anew = std::exchange(clock_began_anew_, false)};
  pending_ = pending_.subspan(chunk.bytes.size());
  byte_offset_ += chunk.bytes.size();
  timer_->Take(chunk.bytes);
  if (pending_.empty()) FollowClock();
  return chunk;
}

void MetavisionEventSource::FollowClock() {
  const int64_t now_us = timer_->time_us();
  // A secondary camera that waits for its primary stands still.
  if (now_us != last_time_us_) {
    arrival_ = FrameArrival{.device_ns = now_us * 1000,
                            .host_monotonic_ns = MonotonicNowNs(),
                            .host_utc_ns = UtcNowNs()};
  }
  last_time_us_ = now_us;
}

void MetavisionEventSource::WarnOfSilence() {
  if (silence_is_logged_ || SteadyClock::now() - silent_since_ < kSilence) return;
  silence_is_logged_ = true;
  spdlog::warn("camera {}: {} has sent nothing for {} s{}", options_.camera, identity_.serial,
               kSilence.count(),
               request_.config.sync == EventCameraSync::kSecondary
                   ? "; does its primary run, and is the sync cable in?"
                   : "");
}

}  // namespace rigcal::agent
