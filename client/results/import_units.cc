// SPDX-License-Identifier: Apache-2.0
#include "client/results/import_units.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/output/quantities.h"

namespace rigcal::client {
namespace {

constexpr std::pair<const char*, double> kLengthUnits[] = {
    {"m", 1}, {"cm", 0.01}, {"mm", 0.001}, {"in", 0.0254}, {"ft", 0.3048}};

// Cameras that are further apart hardly see one wand. In millimetres they are a stereo camera, in
// centimetres a desk.
constexpr double kFurthestM = 100;
// What is this far apart or further in centimetres is a rig in millimetres rather.
constexpr double kFurthestCm = 500;

struct FurthestPair {
  const ImportedCamera *a = nullptr, *b = nullptr;
  double distance = 0;
};

FurthestPair FurthestOf(const ImportedRig& rig) {
  FurthestPair furthest;
  for (const ImportedCamera& a : rig.cameras) {
    for (const ImportedCamera& b : rig.cameras) {
      if (!a.cam_from_rig || !b.cam_from_rig) continue;
      const double distance = (a.cam_from_rig->SourceFromTargetTranslation() -
                               b.cam_from_rig->SourceFromTargetTranslation())
                                  .norm();
      if (distance > furthest.distance) furthest = {&a, &b, distance};
    }
  }
  return furthest;
}

}  // namespace

std::vector<std::string> LengthUnitNames() {
  std::vector<std::string> names;
  for (const auto& [name, metres] : kLengthUnits) names.emplace_back(name);
  return names;
}

std::string ApplyUnits(const std::string& path, const std::string& units, ImportedRig* rig) {
  for (const auto& [name, metres] : kLengthUnits) {
    if (units != name) continue;
    for (ImportedCamera& camera : rig->cameras) {
      if (camera.cam_from_rig) camera.cam_from_rig->translation_m *= metres;
    }
    return "";
  }
  const FurthestPair furthest = FurthestOf(*rig);
  if (furthest.distance < kFurthestM) return "";
  const bool centimetres = furthest.distance < kFurthestCm;
  const std::string unit = centimetres ? "cm" : "mm";
  return absl::StrCat(
      "cameras ", furthest.a->name, " and ", furthest.b->name, " are ",
      FormatFixed(furthest.distance, 1), " m apart, read as metres; 1/", centimetres ? 100 : 1000,
      " of it fits: ", FormatFixed(furthest.distance * (centimetres ? 0.01 : 0.001), 3),
      " m, if the file is in ",
      centimetres ? "centimetres (or millimetres: --units mm)" : "millimetres",
      ". rigcal calibration import ", path, " --units ", unit,
      " --format json --output DIR reads it so; --units m says that it is right");
}

}  // namespace rigcal::client
