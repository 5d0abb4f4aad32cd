// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "common/calibration/calibration.h"
#include "tests/accuracy/solver/doctor_patient.h"

namespace rigcal::accuracy {

// One kind of disturbance, and which findings would name it.
struct Disturbance {
  std::string name;
  std::vector<FindingKind> causes;  // any of these is right; none: nothing is wrong
  std::string message;              // of a refusal that names the cause; empty: none does
  bool of_one_camera = true;        // and finding or message must name it
  bool of_clock = false;            // of that camera: an offset of it is no wrong cause
  std::function<void(uint32_t seed, DoctorPatient* patient)> apply;
  CalibrationOptions options = {};
  bool of_simulation = false;  // cannot be put into a recording
  bool all_causes = false;     // each of them must be named: several things are wrong
};

// Of one camera's track, or of all of them.
Disturbance OfTrack(const std::string& name, std::vector<FindingKind> causes, bool all,
                    const std::function<void(uint32_t seed, server::CameraTrack*)>& change);

// Stamps: jumps, drifts, offsets, rates; their units.
std::vector<Disturbance> ClockDisturbances();
std::vector<Disturbance> UnitDisturbances();
// What a camera sees: noise, mirrors, garbage, a camera that is turned half-way.
std::vector<Disturbance> ImageDisturbances();
// Cameras that are shifted, turned, shaken, or whose lens zooms.
std::vector<Disturbance> MoveDisturbances();
// Wands that bend, sag, or whose markers slip.
std::vector<Disturbance> WandDisturbances();
// Lenses that are described wrongly.
std::vector<Disturbance> LensDisturbances();
// Rolling shutters, flipped labels, lost rows.
std::vector<Disturbance> RowDisturbances();
// Files that are copied, frozen images, second wands, stamps of arrival, what is kept though it is
// wrong.
std::vector<Disturbance> SickCameraDisturbances();

// All of these, wrong wands, too little data, and some of them together. The first one is the clean
// recording.
std::vector<Disturbance> AllDisturbances();

}  // namespace rigcal::accuracy
