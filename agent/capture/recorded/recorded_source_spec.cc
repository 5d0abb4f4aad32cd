// SPDX-License-Identifier: Apache-2.0
// csv:, images:, video:
#include <filesystem>
#include <limits>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/capture/source_kinds.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr double kTiny = std::numeric_limits<double>::min();
constexpr double kLargest = std::numeric_limits<double>::max();

// Paths reach protobuf strings and logs, which must be UTF-8. Overlong forms and surrogates pass:
// protobuf checks no more than that a lead byte has its continuation bytes.
bool IsUtf8(std::string_view text) {
  for (size_t i = 0; i < text.size();) {
    const auto byte = static_cast<unsigned char>(text[i++]);
    const int more = byte < 0x80                   ? 0
                     : byte >= 0xC2 && byte < 0xE0 ? 1
                     : byte >= 0xE0 && byte < 0xF0 ? 2
                     : byte >= 0xF0 && byte < 0xF5 ? 3
                                                   : -1;
    if (more < 0) return false;
    for (int k = 0; k < more; ++k, ++i) {
      if (i >= text.size() || (static_cast<unsigned char>(text[i]) & 0xC0) != 0x80) return false;
    }
  }
  return true;
}

// "rig/left/" is the folder "rig/left".
std::filesystem::path WithoutSlash(const std::string& path) {
  const std::filesystem::path with(path);
  return with.has_filename() ? with : with.parent_path();
}

// What folders of pictures and videos have in common.
template <typename Options>
absl::StatusOr<SourceSpec> ParseFrames(std::string_view kind, SourceText text) {
  RIGCAL_RETURN_IF_ERROR(CheckSourcePath(kind, text.subject));
  Options options;
  options.path = text.subject;
  std::filesystem::path beside = WithoutSlash(text.subject);
  options.camera = text.name.empty() ? beside.stem().string() : text.name;
  options.calibration_path = beside.replace_extension(".yaml").string();
  SourceOptions& given = text.options;
  given.TakeSpeed(&options.speed);
  given.Take("calibration", &options.calibration_path);
  if (options.calibration_path == "none") options.calibration_path.clear();
  given.Take("timestamps", &options.timestamps_path);
  given.Take("fps", "a number of pictures per second above 0", kTiny, 1e6, &options.fps);
  given.Take("exposure", "a time of 0 to 10 s", 0.0, 10.0, &options.exposure_s);
  FrameSourceSpec spec;
  TakeDetectingOptions(&given, &spec.detecting);
  RIGCAL_RETURN_IF_ERROR(given.Finish());
  spec.frames = std::move(options);
  return spec;
}

}  // namespace

absl::Status CheckSourcePath(std::string_view kind, const std::string& path) {
  if (path.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("there is no path behind ", std::string(kind)));
  }
  if (!IsUtf8(path)) return absl::InvalidArgumentError("the path is not UTF-8; rename it");
  return absl::OkStatus();
}

absl::StatusOr<SourceSpec> ParseCsvSource(SourceText text) {
  RIGCAL_RETURN_IF_ERROR(CheckSourcePath("csv:", text.subject));
  CsvSourceOptions options;
  options.path = text.subject;
  const std::filesystem::path path(options.path);
  options.camera = text.name.empty() ? path.stem().string() : text.name;
  options.calibration_path = std::filesystem::path(path).replace_extension(".yaml").string();
  SourceOptions& given = text.options;
  given.TakeSpeed(&options.speed);
  given.Take("sigma", "a number of pixels above 0", kTiny, kLargest, &options.sigma_px);
  given.Take("calibration", &options.calibration_path);
  std::string centres = "blob";
  given.Take("centres", &centres);
  if (centres == "sphere") {
    options.centre_kind = CentreKind::kSphereCentre;
  } else if (centres != "blob") {
    given.AddFault("centres", "is neither blob nor sphere");
  }
  RIGCAL_RETURN_IF_ERROR(given.Finish());
  return options;
}

absl::StatusOr<SourceSpec> ParseImagesSource(SourceText text) {
  return ParseFrames<ImagesSourceOptions>("images:", std::move(text));
}

absl::StatusOr<SourceSpec> ParseVideoSource(SourceText text) {
  return ParseFrames<VideoSourceOptions>("video:", std::move(text));
}

}  // namespace rigcal::agent
