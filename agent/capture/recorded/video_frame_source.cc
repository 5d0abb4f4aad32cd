// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/recorded/video_frame_source.h"

#include <spdlog/spdlog.h>

#include <cmath>
#include <filesystem>
#include <opencv2/core/utils/logger.hpp>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/capture/image_file.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

namespace fs = std::filesystem;

constexpr double kMaxTimeMs = 1e15;  // FFmpeg says "no time" by numbers far beyond

// OpenCV logs each backend that cannot open a file, even if the next one can.
class QuietOpenCv {
 public:
  QuietOpenCv() : level_(cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT)) {}
  ~QuietOpenCv() { cv::utils::logging::setLogLevel(level_); }

 private:
  const cv::utils::logging::LogLevel level_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<VideoFrameSource>> VideoFrameSource::Create(
    RecordedFramesOptions options) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  std::unique_ptr<VideoFrameSource> source(new VideoFrameSource(std::move(options)));
  RIGCAL_RETURN_IF_ERROR(source->Open());
  RIGCAL_RETURN_IF_ERROR(source->DescribeCamera());
  return source;
}

absl::Status VideoFrameSource::Open() {
  std::error_code error;
  if (!fs::is_regular_file(options_.path, error)) {
    return absl::NotFoundError(absl::StrCat(prefix(), "there is no video ", options_.path));
  }
  refused_ = {};
  const auto usual = fs::path(options_.path).replace_extension(".timestamps.csv");
  RIGCAL_ASSIGN_OR_RETURN(FrameTimes times, ReadTimes(usual.string()));
  given_times_ns_ = std::move(times.by_number);
  read_ = 0;
  last_ns_.reset();
  // Named, because OpenCV would otherwise take a name with digits for a series of images.
  const QuietOpenCv quiet;
  for (const int backend : {cv::CAP_FFMPEG, cv::CAP_GSTREAMER}) {
    try {
      if (!video_.open(options_.path, backend)) continue;
      // Frames lie as on the sensor, whatever orientation the file says.
      video_.set(cv::CAP_PROP_ORIENTATION_AUTO, 0);
      return absl::OkStatus();
    } catch (const cv::Exception&) {
    }
  }
  return absl::FailedPreconditionError(
      absl::StrCat(prefix(), options_.path,
                   " cannot be read by FFmpeg or GStreamer; it may be damaged or truncated "
                   "(an mp4 file without its end is lost, an mkv or avi file is not)"));
}

absl::Status VideoFrameSource::DescribeCamera() {
  const std::string video = prefix() + options_.path;
  RIGCAL_ASSIGN_OR_RETURN(const bool has_frame, Read());
  if (!has_frame) return absl::FailedPreconditionError(video + " holds no frame");
  RIGCAL_ASSIGN_OR_RETURN(description_,
                          DescribeRecordedFrames("video", options_, image_.size(), options_.path));
  const std::optional<int64_t> first_ns = TimeOfFrame();
  RIGCAL_ASSIGN_OR_RETURN(const bool has_second, Read());
  const std::optional<int64_t> second_ns = has_second ? TimeOfFrame() : std::nullopt;
  const bool has_times = first_ns && (!has_second || (second_ns && *second_ns > *first_ns));
  if (has_times || !given_times_ns_.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      video,
      " has no times. Add ;fps=RATE if the frame rate is constant, or list the frames' "
      "times, one timestamp_ns per line, in ",
      fs::path(options_.path).stem().string(), ".timestamps.csv beside it"));
}

absl::Status VideoFrameSource::Start(const Target&) {
  RIGCAL_RETURN_IF_ERROR(Open());
  counts_ = {};
  pacer_.Start();
  return absl::OkStatus();
}

absl::StatusOr<bool> VideoFrameSource::Read() {
  try {
    if (!video_.isOpened() || !video_.read(decoded_)) return false;
  } catch (const cv::Exception& error) {
    return absl::DataLossError(absl::StrCat("camera ", options_.camera, ": ", options_.path,
                                            " cannot be read on: ", error.err));
  }
  ++read_;
  RIGCAL_ASSIGN_OR_RETURN(image_, AsEightBit(decoded_, options_.bits));
  return true;
}

std::optional<int64_t> VideoFrameSource::TimeOfFrame() const {
  const uint64_t index = read_ - 1;
  if (!given_times_ns_.empty()) {
    return index < given_times_ns_.size() ? given_times_ns_[index] : std::nullopt;
  }
  if (options_.fps > 0) return std::llround(static_cast<double>(index) * 1e9 / options_.fps);
  const double time_ms = video_.get(cv::CAP_PROP_POS_MSEC);
  if (!(time_ms >= 0 && time_ms < kMaxTimeMs)) return std::nullopt;
  return std::llround(time_ms * 1e6);
}

absl::StatusOr<std::optional<Frame>> VideoFrameSource::Next() {
  while (true) {
    RIGCAL_ASSIGN_OR_RETURN(const bool has_frame, Read());
    if (!has_frame) {
      NoteEnd();
      return std::nullopt;
    }
    const std::string which = absl::StrCat("frame ", read_, " of ", options_.path);
    const std::optional<int64_t> time_ns = TimeOfFrame();
    if (!time_ns || (last_ns_ && *time_ns <= *last_ns_)) {
      Refuse(RefusalReason::kFrameNoTime,
             absl::StrCat(which, " has no time after the previous one"));
      continue;
    }
    last_ns_ = time_ns;
    if (!HasRightSize(image_, which)) continue;
    if (!pacer_.Wait(*time_ns)) return std::nullopt;
    return MakeFrame(*time_ns, 0);
  }
}

void VideoFrameSource::NoteEnd() {
  if (!video_.isOpened()) return;  // noted before
  const double announced = video_.get(cv::CAP_PROP_FRAME_COUNT);
  video_.release();
  // A count made from duration and rate may be one off.
  if (!(announced > static_cast<double>(read_) + 1.5 && announced < 1e9)) return;
  const auto missing = static_cast<uint32_t>(std::llround(announced) - static_cast<int64_t>(read_));
  const std::string what =
      absl::StrCat(options_.path, " announces ", std::llround(announced),
                   " frames, but ends after ", read_, "; it is truncated or damaged");
  spdlog::warn("camera {}: {}", options_.camera, what);
  refused_.Add("", RefusalReason::kVideoTruncated, missing, what);
  counts_.lost += missing;
}

}  // namespace rigcal::agent
