// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <initializer_list>
#include <string>

#include "agent/capture/genicam/aravis_objects.h"

// GenICam features by name; a camera may lack any of them.
namespace rigcal::agent {

inline bool FeatureIsAvailable(ArvCamera* camera, const char* feature) {
  GErrorSlot error;
  return arv_camera_is_feature_available(camera, feature, error.out()) && error.ok();
}

// The first of several names (they changed between versions of the convention) that the camera has.
// None: it has none of them.
inline const char* FirstAvailableFeature(ArvCamera* camera,
                                         std::initializer_list<const char*> names) {
  for (const char* name : names) {
    if (FeatureIsAvailable(camera, name)) return name;
  }
  return nullptr;
}

// Empty: the camera does not say.
inline std::string ReadStringFeature(ArvCamera* camera, const char* feature) {
  if (!FeatureIsAvailable(camera, feature)) return "";
  GErrorSlot error;
  const char* const text = arv_camera_get_string(camera, feature, error.out());
  return text == nullptr || !error.ok() ? "" : text;
}

}  // namespace rigcal::agent
