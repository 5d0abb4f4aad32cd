// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <optional>

#include "common/geometry/rigid_transform.h"
#include "tests/accuracy/solver/doctor_patient.h"

namespace rigcal::accuracy {

// The three markers of a wand in a camera's frame, metres.
using WandInCamera = std::array<Eigen::Vector3d, 3>;

// From one view that shows all three: their spacing says how far the wand is and how it lies. None
// where a marker is not seen or the view is degenerate. Depths are good to some percent, enough to
// disturb a recording by changes that are small against its depths.
std::optional<WandInCamera> WandFromOneView(const Target& target, const Intrinsics& intrinsics,
                                            const Observation& row);

// The camera at `share` of the recording: its pose then, relative to that at its begin.
using Motion = std::function<RigidTransform(double share)>;

// Pictures the wand again from where the camera is then. Rows that do not show the whole wand take
// its depth from the row before; without one they show nothing.
void MoveCamera(const Target& target, const Motion& now_from_begin, server::CameraTrack* track);

// Pictures another wand instead: `change` moves its markers, in the rig's frame. Rows that do not
// show the whole wand show nothing.
void ChangeWand(const std::function<void(double share, WandInCamera*)>& change,
                DoctorPatient* patient);

}  // namespace rigcal::accuracy
