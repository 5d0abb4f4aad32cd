// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/recorded/video_frame_source.h"

#include <spdlog/spdlog.h>

#include <cmath>
#include <filesystem>
#include <opencv2/core/utils/logger.hpp>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/capture/recorded/frame_times.h"
#include "agent/capture/recorded/image_file.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

namespace fs = std::filesystem;

constexpr double kMaxTimeMs = 1e15;  // FFmpeg says "no time" by numbers far beyond

std::string SidecarOf(const VideoSourceOptions& options) {
  if (!options.timestamps_path.empty()) return options.timestamps_path;
  const std::string usual = fs::path(options.path).replace_extension(".timestamps.csv").string();
  std::error_code error;
  return fs::exists(usual, error) ? usual : "";
}

// OpenCV prints what a backend cannot open, even where the next one can; our message says enough.
class QuietOpenCv {
 public:
  QuietOpenCv() : level_(cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT)) {}
  ~QuietOpenCv() { cv::utils::logging::setLogLevel(level_); }

 private:
  const cv::utils::logging::LogLevel level_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<VideoFrameSource>> VideoFrameSource::Create(
    VideoSourceOptions options) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  std::unique_ptr<VideoFrameSource> source(new VideoFrameSource(std::move(options)));
  RIGCAL_RETURN_IF_ERROR(source->Open());
  RIGCAL_RETURN_IF_ERROR(source->Describe());
  return source;
}

VideoFrameSource::VideoFrameSource(VideoSourceOptions options)
    : options_(std::move(options)), pacer_(options_.speed) {}

absl::Status VideoFrameSource::Open() {
  const std::string prefix = absl::StrCat("camera ", options_.camera, ": ");
  std::error_code error;
  if (!fs::is_regular_file(options_.path, error)) {
    return absl::NotFoundError(absl::StrCat(prefix, "there is no video ", options_.path));
  }
  refused_ = {};
  given_times_ns_.clear();
  if (const std::string sidecar = SidecarOf(options_); !sidecar.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(FrameTimes times, ReadImageTimes(sidecar));
    given_times_ns_ = std::move(times.by_number);
    for (const Refusal& refusal : times.refused.List()) refused_.Add(refusal);
  }
  read_ = 0;
  last_ns_.reset();
  // Named, because OpenCV would otherwise take a name with digits for a series of pictures.
  const QuietOpenCv quiet;
  for (const int backend : {cv::CAP_FFMPEG, cv::CAP_GSTREAMER}) {
    try {
      if (!video_.open(options_.path, backend)) continue;
      // A camera's pictures lie as its sensor does, whatever a phone writes beside them.
      video_.set(cv::CAP_PROP_ORIENTATION_AUTO, 0);
      return absl::OkStatus();
    } catch (const cv::Exception&) {
    }
  }
  return absl::FailedPreconditionError(
      absl::StrCat(prefix, options_.path,
                   " is no video that FFmpeg or GStreamer can read; it may be damaged or truncated "
                   "(an mp4 file without its end is lost, an mkv or avi file is not)"));
}

absl::Status VideoFrameSource::Describe() {
  const std::string prefix = absl::StrCat("camera ", options_.camera, ": ", options_.path);
  RIGCAL_ASSIGN_OR_RETURN(const bool has_picture, Read());
  if (!has_picture) return absl::FailedPreconditionError(prefix + " holds no picture");
  RIGCAL_ASSIGN_OR_RETURN(description_,
                          DescribeRecordedCamera(options_.camera, options_.calibration_path,
                                                 picture_.size(), options_.path));
  if (options_.exposure_s > 0) {
    description_.settings.emplace().exposure_s = options_.exposure_s;
  }
  description_.source = absl::StrCat("video:", fs::path(options_.path).filename().string());
  const std::optional<int64_t> first_ns = TimeOfFrame();
  RIGCAL_ASSIGN_OR_RETURN(const bool has_second, Read());
  const std::optional<int64_t> second_ns = has_second ? TimeOfFrame() : std::nullopt;
  const bool has_times = first_ns && (!has_second || (second_ns && *second_ns > *first_ns));
  if (has_times || !given_times_ns_.empty()) return description_.Validate();
  return absl::InvalidArgumentError(absl::StrCat(
      prefix,
      " has no times. Say ;fps=RATE if its pictures follow each other evenly, or list their "
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
  RIGCAL_ASSIGN_OR_RETURN(picture_, AsEightBit(decoded_));
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
    RIGCAL_ASSIGN_OR_RETURN(const bool has_picture, Read());
    if (!has_picture) {
      NoteEnd();
      return std::nullopt;
    }
    const std::string which = absl::StrCat("picture ", read_, " of ", options_.path);
    const std::optional<int64_t> time_ns = TimeOfFrame();
    if (!time_ns || (last_ns_ && *time_ns <= *last_ns_)) {
      Refuse("picture_no_time", absl::StrCat(which, " has no time after that of the one ahead"));
      continue;
    }
    last_ns_ = time_ns;
    const ImageSize& right = description_.image_size_px;
    if (picture_.cols != static_cast<int>(right.width) ||
        picture_.rows != static_cast<int>(right.height)) {
      Refuse("picture_wrong_size",
             absl::StrCat(which, " is ", picture_.cols, "x", picture_.rows,
                          " pixels, the first one ", right.width, "x", right.height));
      continue;
    }
    if (!pacer_.Wait(*time_ns)) return std::nullopt;
    ++counts_.received;
    return Frame{.image = ViewOf(picture_),
                 .time_ns = *time_ns,
                 .clock_epoch = 0,
                 .exposure_s = options_.exposure_s};
  }
}

void VideoFrameSource::NoteEnd() {
  if (!video_.isOpened()) return;  // noted before
  const double said = video_.get(cv::CAP_PROP_FRAME_COUNT);
  video_.release();
  // Where the count is made from duration and rate it may be one off.
  if (!(said > static_cast<double>(read_) + 1.5 && said < 1e9)) return;
  const auto missing = static_cast<uint32_t>(std::llround(said) - static_cast<int64_t>(read_));
  const std::string what =
      absl::StrCat(options_.path, " says it holds ", std::llround(said),
                   " pictures, but ends after ", read_, "; it is truncated or damaged");
  spdlog::warn("camera {}: {}", options_.camera, what);
  refused_.Add("", "video_ends_early", missing, what);
  counts_.lost += missing;
}

void VideoFrameSource::Refuse(std::string_view reason, const std::string& what) {
  spdlog::debug("camera {}: {}: {}", options_.camera, reason, what);
  refused_.Add("", reason, 1, what);
  ++counts_.damaged;
}

}  // namespace rigcal::agent
