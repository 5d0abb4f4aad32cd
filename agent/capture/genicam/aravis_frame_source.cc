// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/aravis_frame_source.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/capture/camera_status.h"
#include "agent/capture/genicam/aravis_pixel_formats.h"
#include "agent/capture/genicam/aravis_settings.h"
#include "common/import/intrinsics_file.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr std::chrono::milliseconds kShortestPause(200);
constexpr std::chrono::milliseconds kLongestPause(5000);
constexpr std::chrono::milliseconds kLongestWait(200);  // then the connection is checked

int64_t ToNs(double seconds) { return static_cast<int64_t>(std::llround(seconds * 1e9)); }

const char* StatusWord(ArvBufferStatus status) {
  constexpr std::pair<ArvBufferStatus, const char*> kWords[] = {
      {ARV_BUFFER_STATUS_TIMEOUT, "packets were late"},
      {ARV_BUFFER_STATUS_MISSING_PACKETS, "packets are missing"},
      {ARV_BUFFER_STATUS_WRONG_PACKET_ID, "a packet's number is wrong"},
      {ARV_BUFFER_STATUS_SIZE_MISMATCH, "it has another size than announced"},
      {ARV_BUFFER_STATUS_ABORTED, "the stream ended in the middle of it"}};
  for (const auto& [known, word] : kWords) {
    if (status == known) return word;
  }
  return "it is incomplete";
}

// The arrival of the first packet. Aravis has it in UTC only.
FrameArrival ArrivalOf(ArvBuffer* buffer, double exposure_s) {
  const int64_t utc_now_ns = UtcNowNs();
  const int64_t monotonic_now_ns = MonotonicNowNs();
  const auto utc_ns = static_cast<int64_t>(arv_buffer_get_system_timestamp(buffer));
  // A wall clock that stepped must not make the frame look old.
  const int64_t age_ns = std::clamp<int64_t>(utc_now_ns - utc_ns, 0, 10'000'000'000);
  return {.device_ns = static_cast<int64_t>(arv_buffer_get_timestamp(buffer)) + ToNs(exposure_s),
          .host_monotonic_ns = monotonic_now_ns - age_ns,
          .host_utc_ns = utc_ns};
}

// The camera's frames must have the size of the calibration.
absl::Status CheckImageSize(const std::string& camera, ImageSize frames_px, ImageSize calibrated_px,
                            const std::string& calibration_path) {
  if (frames_px == calibrated_px) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(
      "camera ", camera, ": its frames have ", frames_px.width, " x ", frames_px.height,
      " pixels, but the intrinsics of ", calibration_path, " are for ", calibrated_px.width, " x ",
      calibrated_px.height,
      "; set the camera's region and binning as they were, or calibrate its lens again"));
}

}  // namespace

absl::StatusOr<std::unique_ptr<AravisFrameSource>> AravisFrameSource::Create(
    AravisSourceOptions options) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  CameraDescription description;
  description.camera = options.camera;
  std::optional<ImageSize> calibrated_px;
  if (!options.calibration_path.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(
        IntrinsicsFile calibration,
        OfCamera(options.camera, ReadIntrinsicsFile(options.calibration_path, options.camera)));
    calibrated_px = calibration.image_size_px;
    description.intrinsics = std::move(calibration.intrinsics);
  }
  RIGCAL_ASSIGN_OR_RETURN(std::unique_ptr<AravisCamera> camera,
                          AravisCamera::Open(options, /*list_others=*/true));
  if (calibrated_px) {
    RIGCAL_RETURN_IF_ERROR(CheckImageSize(options.camera, camera->image_size_px(), *calibrated_px,
                                          options.calibration_path));
  }
  for (const std::string& warning : SettingWarnings(camera->get(), options, camera->settings())) {
    spdlog::warn("camera {}: {}", options.camera, warning);
  }
  description.image_size_px = camera->image_size_px();
  description.clock = camera->ptp_clock_id().empty()
                          ? Clock{.clock_id = camera->device_id(), .timebase = ""}
                          : Clock{.clock_id = camera->ptp_clock_id(), .timebase = "ptp"};
  description.latency_s = options.latency_s;
  description.sensor = SensorKind::kFrame;
  description.source = absl::StrCat("aravis:", options.device);
  description.settings = camera->settings();
  RIGCAL_RETURN_IF_ERROR(description.Validate());
  std::unique_ptr<AravisFrameSource> source(
      new AravisFrameSource(std::move(options), std::move(description)));
  source->camera_ = std::move(camera);
  return source;
}

absl::Status AravisFrameSource::Start(const Target&) {
  EndStream();
  counts_ = {};
  refused_ = {};
  lost_before_ = 0;
  clock_ = {};
  stopped_ = false;
  if (camera_ && !camera_->control_lost()) return BeginStream();
  return absl::OkStatus();  // Next looks for it
}

absl::Status AravisFrameSource::BeginStream() {
  frame_ids_.Restart();
  lost_by_id_ = 0;
  exposure_s_ = camera_->settings().exposure_s;
  clock_can_be_read_ = camera_->CanReadClock();
  RIGCAL_ASSIGN_OR_RETURN(
      stream_, OfCamera(options_.camera, AravisStream::Start(camera_.get(), options_, &bell_)));
  next_trigger_ = std::chrono::steady_clock::now();
  return absl::OkStatus();
}

void AravisFrameSource::EndStream() {
  if (!stream_) return;
  if (held_ != nullptr) stream_->GiveBack(std::exchange(held_, nullptr));
  stream_->StopCamera();
  do {
    while (ArvBuffer* const buffer = stream_->TryPop()) {
      Count(buffer);
      stream_->GiveBack(buffer);
    }
  } while (stream_->WaitForLast());
  const uint64_t without_buffer = stream_->underruns();
  refused_.Add("", RefusalReason::kFrameNoBuffer, static_cast<uint32_t>(without_buffer),
               "every buffer was in use; the detector is slower than the camera");
  // Those without a buffer leave a gap in the numbers, except at the end.
  lost_before_ += std::max(lost_by_id_, without_buffer);
  lost_by_id_ = 0;
  counts_.lost = lost_before_;
  stream_.reset();
}

void AravisFrameSource::Stop() {
  stopped_ = true;
  bell_.Ring();
}

absl::StatusOr<std::optional<Frame>> AravisFrameSource::Next() {
  while (true) {
    if (stream_ && held_ != nullptr) stream_->GiveBack(std::exchange(held_, nullptr));
    if (stopped_) {
      EndStream();
      return std::nullopt;
    }
    if (!stream_ || camera_->control_lost()) {
      if (!Reconnect()) return std::nullopt;
      continue;
    }
    const std::chrono::milliseconds wait = TriggerIfDue();
    ArvBuffer* const buffer = stream_->TryPop();
    if (buffer == nullptr) {
      bell_.Wait(wait);
      continue;
    }
    const std::optional<Frame> frame = Count(buffer) ? ToFrame(buffer) : std::nullopt;
    if (!frame) {
      stream_->GiveBack(buffer);
      continue;
    }
    held_ = buffer;
    return frame;
  }
}

bool AravisFrameSource::Count(ArvBuffer* buffer) {
  const ArvBufferStatus status = arv_buffer_get_status(buffer);
  if (status == ARV_BUFFER_STATUS_CLEARED) return false;  // given back, never used
  const uint64_t id = arv_buffer_get_frame_id(buffer);
  if (status == ARV_BUFFER_STATUS_SUCCESS || id != 0) {
    const uint64_t lost = frame_ids_.Arrived(id);
    lost_by_id_ += lost;
    counts_.lost = lost_before_ + lost_by_id_;
    refused_.Add("", RefusalReason::kFrameLost, static_cast<uint32_t>(lost),
                 absl::StrCat(lost, " before number ", id, " never arrived"));
  } else {
    frame_ids_.ArrivedWithoutId();
  }
  if (status != ARV_BUFFER_STATUS_SUCCESS) {
    Damaged(RefusalReason::kFrameIncomplete, absl::StrCat("number ", id, ": ", StatusWord(status)));
    return false;
  }
  ++counts_.received;
  return true;
}

void AravisFrameSource::Damaged(RefusalReason reason, const std::string& example) {
  ++counts_.damaged;
  refused_.Add("", reason, 1, example);
  spdlog::debug("camera {}: {}: {}", options_.camera, NameOf(reason), example);
}

std::optional<Frame> AravisFrameSource::ToFrame(ArvBuffer* buffer) {
  size_t size_bytes = 0;
  const void* const data = arv_buffer_get_image_data(buffer, &size_bytes);
  const int width = arv_buffer_get_image_width(buffer);
  const int height = arv_buffer_get_image_height(buffer);
  int x_padding = 0;
  int y_padding = 0;
  arv_buffer_get_image_padding(buffer, &x_padding, &y_padding);
  const auto format = FindPixelFormat(arv_buffer_get_image_pixel_format(buffer));
  const ImageSize size_px{static_cast<uint32_t>(width), static_cast<uint32_t>(height)};
  const auto refused = [&](const std::string& why) {
    --counts_.received;
    Damaged(RefusalReason::kFrameWrongSize, why);
    return std::nullopt;
  };
  if (!format || size_px != description_.image_size_px) {
    return refused(absl::StrCat(width, " x ", height, " pixels",
                                format ? "" : " in a format that is not supported",
                                "; did another program change the camera's settings?"));
  }
  const absl::StatusOr<ImageView> view =
      ViewPixels(*format, static_cast<const uint8_t*>(data), size_bytes, width, height, x_padding,
                 &converted_);
  if (!view.ok()) return refused(std::string(view.status().message()));
  Frame frame;
  frame.image = *view;
  FollowClock(buffer, &frame);
  return frame;
}

void AravisFrameSource::FollowClock(ArvBuffer* buffer, Frame* frame) {
  const auto stamp_ns = static_cast<int64_t>(arv_buffer_get_timestamp(buffer));
  const FrameArrival arrival = ArrivalOf(buffer, exposure_s_);
  frame->clock_epoch = clock_.EpochOf(stamp_ns, arrival);
  frame->exposure_s = exposure_s_;
  frame->time_ns = stamp_ns + ToNs(exposure_s_) / 2;
  if (!clock_can_be_read_) {
    clock_.AddArrival(arrival);
  } else if (clock_.ReadingIsDue(arrival.host_monotonic_ns)) {
    const absl::StatusOr<ClockSample> reading = camera_->ReadClock();
    if (!reading.ok() || !clock_.AddReading(*reading)) {
      clock_can_be_read_ = false;
      spdlog::warn(
          "camera {}: its clock is estimated from the arrival of frames, to about {} ms: {}",
          options_.camera, DeviceClock::kArrivalUncertaintyNs / 1'000'000,
          reading.ok() ? "the latched clock is not that of the timestamps"
                       : std::string(reading.status().message()));
    }
  }
  if (camera_->exposure_is_automatic() && arrival.host_monotonic_ns >= next_exposure_ns_) {
    exposure_s_ = ExposureSeconds(camera_->get());
    next_exposure_ns_ = arrival.host_monotonic_ns + DeviceClock::kIntervalNs;
  }
}

bool AravisFrameSource::Reconnect() {
  using Clock = std::chrono::steady_clock;
  spdlog::warn("camera {}: {} was lost; trying to reopen it", options_.camera, options_.device);
  refused_.Add("", RefusalReason::kCameraLost, 1,
               absl::StrCat(options_.device, " was unplugged or taken"));
  EndStream();
  camera_.reset();
  const Clock::time_point began = Clock::now();
  std::string last_reason;
  for (auto pause = kShortestPause; !stopped_; pause = std::min(2 * pause, kLongestPause)) {
    const absl::Status status = OpenAgain();
    if (status.ok()) {
      ++counts_.reconnects;
      clock_.Reconnected();
      spdlog::info("camera {}: {} is back after {:.1f} s", options_.camera, options_.device,
                   std::chrono::duration<double>(Clock::now() - began).count());
      return true;
    }
    const std::string reason(status.message());
    if (reason != last_reason) spdlog::info("camera {}: not reopened: {}", options_.camera, reason);
    last_reason = reason;
    if (!Pause(pause)) break;
  }
  return false;
}

absl::Status AravisFrameSource::OpenAgain() {
  RIGCAL_ASSIGN_OR_RETURN(camera_, AravisCamera::Open(options_, /*list_others=*/false));
  absl::Status status;
  // It must match the description.
  if (camera_->image_size_px() != description_.image_size_px) {
    status = CheckImageSize(options_.camera, camera_->image_size_px(), description_.image_size_px,
                            "this capture");
  } else if (const std::string& clock_id =
                 camera_->ptp_clock_id().empty() ? camera_->device_id() : camera_->ptp_clock_id();
             clock_id != description_.clock.clock_id) {
    status = absl::FailedPreconditionError(
        absl::StrCat("camera ", options_.camera, ": another camera or clock answers: ", clock_id,
                     " instead of ", description_.clock.clock_id));
  } else {
    status = BeginStream();
  }
  if (!status.ok()) camera_.reset();
  return status;
}

bool AravisFrameSource::Pause(std::chrono::milliseconds time) {
  const auto deadline = std::chrono::steady_clock::now() + time;
  while (!stopped_) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        deadline - std::chrono::steady_clock::now());
    if (left.count() <= 0) return true;
    bell_.Wait(left);
  }
  return false;
}

std::chrono::milliseconds AravisFrameSource::TriggerIfDue() {
  using Clock = std::chrono::steady_clock;
  if (options_.trigger != "software") return kLongestWait;
  const Clock::time_point now = Clock::now();
  if (now >= next_trigger_) {
    GErrorSlot error;
    arv_camera_software_trigger(camera_->get(), error.out());
    if (!error.ok()) spdlog::debug("camera {}: trigger: {}", options_.camera, error.message());
    const auto period = std::chrono::duration_cast<Clock::duration>(
        std::chrono::duration<double>(1 / options_.frame_rate_hz.value_or(1)));
    // A late trigger is not made up for by two at once.
    next_trigger_ = std::max(next_trigger_ + period, now);
  }
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(next_trigger_ - now);
  return std::min(left, kLongestWait);
}

}  // namespace rigcal::agent
