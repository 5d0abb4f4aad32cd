// SPDX-License-Identifier: Apache-2.0
#include "common/import/scene_json.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "common/import/convention.h"
#include "common/status/status_macros.h"
#include "common/text/nesting.h"

namespace rigcal {

absl::StatusOr<SceneJson> SceneOf(const std::string& path, const std::string& text) {
  SceneJson json = ParseJson<SceneJson>(text);
  if (!json.is_object()) return ImportError(path, 0, "is not JSON");
  return json;
}

const SceneJson& FieldOf(const SceneJson& object, const char* key) {
  static const auto* const kNull = new SceneJson();
  if (!object.is_object()) return *kNull;
  const auto found = object.find(key);
  return found == object.end() ? *kNull : *found;
}

std::optional<double> NumberAt(const SceneJson& object, const char* key) {
  const SceneJson& value = FieldOf(object, key);
  if (!value.is_number()) return std::nullopt;
  const double number = value.get<double>();
  return std::isfinite(number) ? std::optional(number) : std::nullopt;
}

std::string TextAt(const SceneJson& object, const char* key) {
  const SceneJson& value = FieldOf(object, key);
  return value.is_string() ? value.get<std::string>() : "";
}

absl::Status SetSize(std::optional<double> width, std::optional<double> height,
                     ImportedCamera* camera) {
  const auto good = [](std::optional<double> side) {
    return side && *side >= 1 && *side <= kMaxImageSidePx && *side == std::floor(*side);
  };
  if (!good(width) || !good(height)) {
    return absl::InvalidArgumentError("has no size of its image in whole pixels");
  }
  camera->image_size_px = {static_cast<uint32_t>(*width), static_cast<uint32_t>(*height)};
  return absl::OkStatus();
}

absl::StatusOr<ImportedCamera> PlacedCamera(const std::string& path, const std::string& name,
                                            absl::StatusOr<ImportedCamera> camera) {
  if (!camera.ok()) {
    return ImportError(path, 0,
                       absl::StrCat("camera ", name, " ", std::string(camera.status().message())));
  }
  RIGCAL_RETURN_IF_ERROR(CheckImported(path, 0, *camera));
  return camera;
}

absl::StatusOr<ImportedRig> FinishedRig(const std::string& path, ImportedRig rig) {
  RIGCAL_RETURN_IF_ERROR(CheckNames(path, rig));
  RecogniseConvention(&rig);
  return rig;
}

}  // namespace rigcal
