// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/recorded/images_frame_source.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/capture/image_file.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

namespace fs = std::filesystem;

// A recording may begin with damaged images; one good image among the first ones decides.
constexpr size_t kImagesRead = 20;
// No camera has 100 kHz: such times are not in nanoseconds.
constexpr int64_t kShortestStepNs = 10'000;

}  // namespace

absl::StatusOr<std::unique_ptr<ImagesFrameSource>> ImagesFrameSource::Create(
    RecordedFramesOptions options) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  std::unique_ptr<ImagesFrameSource> source(new ImagesFrameSource(std::move(options)));
  RIGCAL_RETURN_IF_ERROR(source->List());
  RIGCAL_RETURN_IF_ERROR(source->DescribeCamera());
  return source;
}

absl::Status ImagesFrameSource::List() {
  images_.clear();
  refused_ = {};
  std::error_code error;
  if (fs::is_regular_file(options_.path, error)) {
    images_.push_back({.path = options_.path, .time_ns = std::nullopt});
    return AssignTimes();
  }
  std::vector<std::string> names;
  for (fs::directory_iterator entry(options_.path, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (IsImageName(name) && !entry->is_directory()) names.push_back(name);
  }
  if (error) {
    return absl::NotFoundError(
        absl::StrCat(prefix(), "cannot read the folder ", options_.path, ": ", error.message()));
  }
  if (names.empty()) {
    return absl::NotFoundError(absl::StrCat(prefix(), "there is no image in the folder ",
                                            options_.path,
                                            " (png, jpg, bmp, tif, pgm, ppm, webp)"));
  }
  std::sort(names.begin(), names.end(), NaturallyBefore);
  for (const std::string& name : names) {
    images_.push_back({.path = (fs::path(options_.path) / name).string(), .time_ns = std::nullopt});
  }
  return AssignTimes();
}

absl::Status ImagesFrameSource::AssignTimes() {
  const std::string usual = (fs::path(options_.path) / "timestamps.csv").string();
  RIGCAL_ASSIGN_OR_RETURN(const FrameTimes times, ReadTimes(usual));
  std::vector<int64_t> known_ns;
  for (size_t i = 0; i < images_.size(); ++i) {
    const std::string name = fs::path(images_[i].path).filename().string();
    std::optional<int64_t>& time_ns = images_[i].time_ns;
    if (times.is_there) {
      const auto found = times.by_name.find(name);
      if (found != times.by_name.end()) time_ns = found->second;
    } else if (options_.fps > 0) {
      time_ns = std::llround(static_cast<double>(i) * 1e9 / options_.fps);
    } else {
      time_ns = TimeFromName(name);
    }
    if (time_ns) known_ns.push_back(*time_ns);
  }
  if (known_ns.empty() && images_.size() == 1) {
    images_.front().time_ns = 0;  // a single image needs no order
  } else if (known_ns.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(
        prefix(), "no image of ", options_.path,
        " has a time. Name them by it in nanoseconds (at least ten digits, as in "
        "frame_0000000040000000.png), list them in timestamps.csv (name;timestamp_ns), or add "
        ";fps=RATE if the frame rate is constant"));
  }
  if (const int64_t step_ns = MedianStepNs(known_ns); step_ns > 0 && step_ns < kShortestStepNs) {
    return absl::InvalidArgumentError(
        absl::StrCat(prefix(), "the times of ", options_.path, " follow each other by ", step_ns,
                     " ns; are they micro- or milliseconds? Times must be in nanoseconds"));
  }
  return absl::OkStatus();
}

absl::Status ImagesFrameSource::DescribeCamera() {
  absl::Status last = absl::OkStatus();
  for (size_t i = 0; i < std::min(images_.size(), kImagesRead); ++i) {
    int used_bits = 0;
    const absl::StatusOr<cv::Mat> image = ReadImage(images_[i].path, options_.bits, &used_bits);
    if (!image.ok()) {
      last = image.status();
      continue;
    }
    auto described = DescribeRecordedFrames("images", options_, image->size(), images_[i].path);
    if (described.ok()) {
      if (used_bits > 8 && used_bits < options_.bits - 1) {
        spdlog::warn(
            "camera {}: the brightest pixel of {} has {} of {} bits, so it looks dark. If the "
            "camera has {} bits, add bits={}",
            options_.camera, images_[i].path, used_bits, options_.bits, used_bits, used_bits);
      }
      description_ = *std::move(described);
      return absl::OkStatus();
    }
    last = described.status();
    // A single image of another size among right ones is refused when its turn comes.
    if (!absl::IsInvalidArgument(last) || i + 1 == kImagesRead) return last;
  }
  if (!absl::IsDataLoss(last)) return last;
  return absl::FailedPreconditionError(
      absl::StrCat("camera ", options_.camera,
                   ": none of the first images can be read: ", std::string(last.message())));
}

absl::Status ImagesFrameSource::Start(const Target&) {
  RIGCAL_RETURN_IF_ERROR(List());
  next_ = 0;
  clock_epochs_ = {};
  clock_epoch_ = 0;
  counts_ = {};
  pacer_.Start();
  return absl::OkStatus();
}

absl::StatusOr<std::optional<Frame>> ImagesFrameSource::Next() {
  while (next_ < images_.size()) {
    const TimedFrame& timed = images_[next_++];
    if (!timed.time_ns) {
      Refuse(RefusalReason::kFrameNoTime, absl::StrCat(timed.path, " has no time"));
      continue;
    }
    if (!pacer_.Wait(*timed.time_ns)) break;
    absl::StatusOr<cv::Mat> image = ReadImage(timed.path, options_.bits);
    if (!image.ok()) {
      Refuse(RefusalReason::kFrameUnreadable, std::string(image.status().message()));
      continue;
    }
    if (!HasRightSize(*image, timed.path)) continue;
    image_ = *std::move(image);
    return MakeFrame(*timed.time_ns, ClockEpochOf(timed), timed.path);
  }
  return std::nullopt;
}

uint32_t ImagesFrameSource::ClockEpochOf(const TimedFrame& image) {
  const uint32_t epoch = clock_epochs_.EpochOf(*image.time_ns);
  if (epoch != clock_epoch_) {
    clock_epoch_ = epoch;
    spdlog::warn(
        "camera {}: the time of {} is before that of the previous image; what follows is "
        "clock epoch {}: stored, but used only if its own time offset can be found",
        options_.camera, image.path, epoch);
  }
  return epoch;
}

}  // namespace rigcal::agent
