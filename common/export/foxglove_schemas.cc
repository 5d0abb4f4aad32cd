// SPDX-License-Identifier: Apache-2.0
#include "common/export/foxglove_schemas.h"

#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

namespace rigcal {
namespace {

using Json = nlohmann::ordered_json;

Json TypeOf(const char* type) { return {{"type", type}}; }

Json ObjectOf(const std::vector<std::pair<std::string, Json>>& properties) {
  Json object = TypeOf("object");
  for (const auto& [name, schema] : properties) object["properties"][name] = schema;
  return object;
}

Json TitledObject(const char* title, const std::vector<std::pair<std::string, Json>>& properties) {
  Json object = {{"title", title}};
  object.update(ObjectOf(properties));
  return object;
}

Json ArrayOf(const Json& items, int count = 0) {
  Json array = {{"type", "array"}, {"items", items}};
  if (count > 0) array["minItems"] = array["maxItems"] = count;
  return array;
}

Json Timestamp() {
  Json seconds = TypeOf("integer");
  seconds["minimum"] = 0;
  Json nanoseconds = seconds;
  nanoseconds["maximum"] = 999'999'999;
  return TitledObject("time", {{"sec", seconds}, {"nsec", nanoseconds}});
}

}  // namespace

std::string FoxgloveCameraCalibrationSchema() {
  const Json number = TypeOf("number");
  return TitledObject("foxglove.CameraCalibration", {{"timestamp", Timestamp()},
                                                     {"frame_id", TypeOf("string")},
                                                     {"width", TypeOf("integer")},
                                                     {"height", TypeOf("integer")},
                                                     {"distortion_model", TypeOf("string")},
                                                     {"D", ArrayOf(number)},
                                                     {"K", ArrayOf(number, 9)},
                                                     {"R", ArrayOf(number, 9)},
                                                     {"P", ArrayOf(number, 12)}})
      .dump();
}

std::string FoxgloveFrameTransformsSchema() {
  const Json number = TypeOf("number");
  const Json vector =
      TitledObject("foxglove.Vector3", {{"x", number}, {"y", number}, {"z", number}});
  const Json quaternion = TitledObject(
      "foxglove.Quaternion", {{"x", number}, {"y", number}, {"z", number}, {"w", number}});
  const Json transform =
      TitledObject("foxglove.FrameTransform", {{"timestamp", Timestamp()},
                                               {"parent_frame_id", TypeOf("string")},
                                               {"child_frame_id", TypeOf("string")},
                                               {"translation", vector},
                                               {"rotation", quaternion}});
  return TitledObject("foxglove.FrameTransforms", {{"transforms", ArrayOf(transform)}}).dump();
}

}  // namespace rigcal
