// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/recorded/images_frame_source.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/capture/recorded/frame_times.h"
#include "agent/capture/recorded/image_file.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

namespace fs = std::filesystem;

// A recording may begin with damaged pictures; one good picture among the first ones decides.
constexpr size_t kPicturesLookedAt = 20;
// No camera takes pictures at 100 kHz: such times are not in nanoseconds.
constexpr int64_t kShortestStepNs = 10'000;

}  // namespace

absl::StatusOr<std::unique_ptr<ImagesFrameSource>> ImagesFrameSource::Create(
    ImagesSourceOptions options) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  std::unique_ptr<ImagesFrameSource> source(new ImagesFrameSource(std::move(options)));
  RIGCAL_RETURN_IF_ERROR(source->List());
  RIGCAL_RETURN_IF_ERROR(source->Describe());
  return source;
}

ImagesFrameSource::ImagesFrameSource(ImagesSourceOptions options)
    : options_(std::move(options)), pacer_(options_.speed) {}

absl::Status ImagesFrameSource::List() {
  pictures_.clear();
  refused_ = {};
  const std::string prefix = absl::StrCat("camera ", options_.camera, ": ");
  std::error_code error;
  if (fs::is_regular_file(options_.path, error)) {
    pictures_.push_back({.path = options_.path, .time_ns = std::nullopt});
    return AssignTimes();
  }
  std::vector<std::string> names;
  for (fs::directory_iterator entry(options_.path, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (IsImageName(name) && !entry->is_directory()) names.push_back(name);
  }
  if (error) {
    return absl::NotFoundError(absl::StrCat(prefix, "cannot read the folder of pictures ",
                                            options_.path, ": ", error.message()));
  }
  if (names.empty()) {
    return absl::NotFoundError(absl::StrCat(prefix, "there is no picture in the folder ",
                                            options_.path,
                                            " (png, jpg, bmp, tif, pgm, ppm, webp)"));
  }
  std::sort(names.begin(), names.end(), NaturallyBefore);
  for (const std::string& name : names) {
    pictures_.push_back(
        {.path = (fs::path(options_.path) / name).string(), .time_ns = std::nullopt});
  }
  return AssignTimes();
}

absl::Status ImagesFrameSource::AssignTimes() {
  std::string sidecar = options_.timestamps_path;
  std::error_code error;
  if (const fs::path usual = fs::path(options_.path) / "timestamps.csv";
      sidecar.empty() && fs::exists(usual, error)) {
    sidecar = usual.string();
  }
  FrameTimes times;
  if (!sidecar.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(times, ReadImageTimes(sidecar));
    for (const Refusal& refusal : times.refused.List()) refused_.Add(refusal);
  }
  std::vector<int64_t> known_ns;
  for (size_t i = 0; i < pictures_.size(); ++i) {
    const std::string name = fs::path(pictures_[i].path).filename().string();
    std::optional<int64_t>& time_ns = pictures_[i].time_ns;
    if (!sidecar.empty()) {
      const auto found = times.by_name.find(name);
      if (found != times.by_name.end()) time_ns = found->second;
    } else if (options_.fps > 0) {
      time_ns = std::llround(static_cast<double>(i) * 1e9 / options_.fps);
    } else {
      time_ns = TimeFromName(name);
    }
    if (time_ns) known_ns.push_back(*time_ns);
  }
  const std::string prefix = absl::StrCat("camera ", options_.camera, ": ");
  if (known_ns.empty() && pictures_.size() == 1) {
    pictures_.front().time_ns = 0;  // one picture needs no order
  } else if (known_ns.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(
        prefix, "no picture of ", options_.path,
        " has a time. Name them by it in nanoseconds (at least ten digits, as in "
        "frame_0000000040000000.png), list them in timestamps.csv (name;timestamp_ns), or say "
        ";fps=RATE for pictures that follow each other evenly"));
  }
  if (const int64_t step_ns = MedianStepNs(known_ns); step_ns > 0 && step_ns < kShortestStepNs) {
    return absl::InvalidArgumentError(
        absl::StrCat(prefix, "the times of ", options_.path, " follow each other by ", step_ns,
                     " ns; are they micro- or milliseconds? Times must be in nanoseconds"));
  }
  return absl::OkStatus();
}

absl::Status ImagesFrameSource::Describe() {
  absl::Status last = absl::OkStatus();
  for (size_t i = 0; i < std::min(pictures_.size(), kPicturesLookedAt); ++i) {
    const absl::StatusOr<cv::Mat> picture = ReadImage(pictures_[i].path);
    if (!picture.ok()) {
      last = picture.status();
      continue;
    }
    auto description = DescribeRecordedCamera(options_.camera, options_.calibration_path,
                                              picture->size(), pictures_[i].path);
    if (!description.ok()) {
      // A single picture of another size among right ones is refused when its turn comes.
      last = description.status();
      if (absl::IsInvalidArgument(last) && i + 1 < kPicturesLookedAt) continue;
      return last;
    }
    description_ = *std::move(description);
    if (options_.exposure_s > 0) {
      description_.settings.emplace().exposure_s = options_.exposure_s;
    }
    description_.source = absl::StrCat("images:", fs::path(options_.path).filename().string());
    return description_.Validate();
  }
  if (!absl::IsDataLoss(last)) return last;
  return absl::FailedPreconditionError(
      absl::StrCat("camera ", options_.camera,
                   ": none of the first pictures can be read: ", std::string(last.message())));
}

absl::Status ImagesFrameSource::Start(const Target&) {
  RIGCAL_RETURN_IF_ERROR(List());
  next_ = 0;
  counts_ = {};
  clock_epochs_ = {};
  clock_epoch_ = 0;
  pacer_.Start();
  return absl::OkStatus();
}

absl::StatusOr<std::optional<Frame>> ImagesFrameSource::Next() {
  while (next_ < pictures_.size()) {
    const TimedFrame& timed = pictures_[next_++];
    if (!timed.time_ns) {
      Refuse("picture_no_time", absl::StrCat(timed.path, " has no time"));
      continue;
    }
    if (!pacer_.Wait(*timed.time_ns)) break;
    absl::StatusOr<cv::Mat> picture = ReadImage(timed.path);
    if (!picture.ok()) {
      Refuse("picture_unreadable", std::string(picture.status().message()));
      continue;
    }
    const ImageSize size = {static_cast<uint32_t>(picture->cols),
                            static_cast<uint32_t>(picture->rows)};
    if (const ImageSize& right = description_.image_size_px; size != right) {
      Refuse("picture_wrong_size", absl::StrCat(timed.path, " is ", size.width, "x", size.height,
                                                " pixels, but the camera's pictures are ",
                                                right.width, "x", right.height));
      continue;
    }
    picture_ = *std::move(picture);
    ++counts_.received;
    return Frame{.image = ViewOf(picture_),
                 .time_ns = *timed.time_ns,
                 .clock_epoch = ClockEpochOf(timed),
                 .exposure_s = options_.exposure_s};
  }
  return std::nullopt;
}

uint32_t ImagesFrameSource::ClockEpochOf(const TimedFrame& picture) {
  const uint32_t epoch = clock_epochs_.EpochOf(*picture.time_ns);
  if (epoch != clock_epoch_) {
    clock_epoch_ = epoch;
    spdlog::warn(
        "camera {}: the time of {} lies before that of the picture ahead of it; what follows is "
        "clock epoch {}: stored, but used only if its own time offset can be found",
        options_.camera, picture.path, epoch);
  }
  return epoch;
}

void ImagesFrameSource::Refuse(std::string_view reason, const std::string& what) {
  spdlog::debug("camera {}: {}: {}", options_.camera, reason, what);
  refused_.Add("", reason, 1, what);
  ++counts_.damaged;
}

}  // namespace rigcal::agent
