// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/learning/kept_detector.h"

#include <fstream>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/capture/static_mask.h"
#include "common/file/durable_file.h"
#include "common/status/status_macros.h"
#include "common/text/nesting.h"

namespace rigcal::agent {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

absl::Status KeepFault(const fs::path& path, const std::string& why) {
  return absl::InternalError(
      absl::StrCat("cannot keep what was learnt in ", path.string(), ": ", why));
}

absl::Status Remove(const fs::path& path) {
  std::error_code error;
  fs::remove(path, error);
  return error ? KeepFault(path, error.message()) : absl::OkStatus();
}

// Writes beside `path` with its extension, and puts the result in its place.
absl::Status Replace(const fs::path& path, const std::function<absl::Status(std::string)>& write) {
  fs::path beside = path;
  beside.replace_filename("." + path.filename().string());
  if (absl::Status status = write(beside.string()); !status.ok()) {
    return KeepFault(path, std::string(status.message()));
  }
  const absl::Status renamed = SyncAndRename(beside, path);
  return renamed.ok() ? renamed : KeepFault(path, std::string(renamed.message()));
}

json ToJson(const ColourRange& colour) {
  return {{"hue_min", colour.hue_min_deg},
          {"hue_max", colour.hue_max_deg},
          {"saturation_min", colour.saturation_min},
          {"value_min", colour.value_min},
          {"washed_out_min", colour.washed_out_min}};
}

absl::StatusOr<ColourRange> ReadColour(const fs::path& path) {
  try {
    std::ifstream stream(path, std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(stream), {}};
    const json kept = ParseJson<json>(text);
    const ColourRange colour = {.hue_min_deg = kept.at("hue_min").get<double>(),
                                .hue_max_deg = kept.at("hue_max").get<double>(),
                                .saturation_min = kept.at("saturation_min").get<double>(),
                                .value_min = kept.at("value_min").get<int>(),
                                .washed_out_min = kept.at("washed_out_min").get<int>()};
    RIGCAL_RETURN_IF_ERROR(colour.Validate());
    return colour;
  } catch (const json::exception&) {
    return absl::InvalidArgumentError("it is damaged");
  }
}

}  // namespace

absl::Status KeepDetector(const fs::path& folder, const DetectorControl& detector) {
  if (folder.empty()) return absl::OkStatus();
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return KeepFault(folder, error.message());
  const fs::path colour_path = folder / (detector.camera().camera + ".json");
  const fs::path mask_path = folder / (detector.camera().camera + ".png");
  if (const auto colour = detector.learnt_colour()) {
    const absl::Status written = WriteDurableFile(colour_path, ToJson(*colour).dump(2) + "\n");
    if (!written.ok()) return KeepFault(colour_path, std::string(written.message()));
  } else {
    RIGCAL_RETURN_IF_ERROR(Remove(colour_path));
  }
  const PixelMask mask = detector.learnt_mask();
  if (mask.width() == 0) return Remove(mask_path);
  return Replace(mask_path, [&](const std::string& path) { return WriteMask(mask, path); });
}

absl::Status RestoreDetector(const fs::path& folder, DetectorControl* detector) {
  if (folder.empty()) return absl::OkStatus();
  const std::string& camera = detector->camera().camera;
  absl::Status fault;
  const auto note = [&](const fs::path& path, const absl::Status& status) {
    fault = absl::InvalidArgumentError(
        absl::StrCat("camera ", camera, ": what was learnt is not used, ", path.string(), ": ",
                     std::string(status.message()), "; learn it again"));
  };
  std::error_code ignored;
  if (const fs::path path = folder / (camera + ".json"); fs::exists(path, ignored)) {
    const absl::StatusOr<ColourRange> colour = ReadColour(path);
    if (colour.ok()) {
      detector->SetColour(*colour);
    } else {
      note(path, colour.status());
    }
  }
  if (const fs::path path = folder / (camera + ".png"); fs::exists(path, ignored)) {
    absl::StatusOr<PixelMask> mask = ReadMask(path.string(), detector->camera().image_size_px);
    if (mask.ok()) {
      detector->SetMask(*std::move(mask));
    } else {
      note(path, mask.status());
    }
  }
  return fault;
}

}  // namespace rigcal::agent
