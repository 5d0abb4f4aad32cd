// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/import/imported_rig.h"

namespace rigcal {

// What readers of JSON files with whole scenes have in common. Nothing here throws.
using SceneJson = nlohmann::json;

// INVALID_ARGUMENT: no JSON, or no object.
absl::StatusOr<SceneJson> SceneOf(const std::string& path, const std::string& text);

// A value of an object, whatever that is; null where there is none.
const SceneJson& FieldOf(const SceneJson& object, const char* key);
// None: not there, no number, or not finite.
std::optional<double> NumberAt(const SceneJson& object, const char* key);
// Empty: not there, or no text.
std::string TextAt(const SceneJson& object, const char* key);

// INVALID_ARGUMENT: a side is not there or no whole number of pixels within bounds. The message
// begins with a verb.
absl::Status SetSize(std::optional<double> width, std::optional<double> height,
                     ImportedCamera* camera);

// The camera with its values checked; where it stands begins what is wrong with it.
absl::StatusOr<ImportedCamera> PlacedCamera(const std::string& path, const std::string& name,
                                            absl::StatusOr<ImportedCamera> camera);

// The rig with its names checked and its convention recognised.
absl::StatusOr<ImportedRig> FinishedRig(const std::string& path, ImportedRig rig);

}  // namespace rigcal
