// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "common/export/archive.h"
#include "common/export/rig_model.h"

// One writer per format, each in a file of its own: xyz_writer.cc. All of them hold image size,
// lens and pose of every camera; docs/exports.md says what else, and in which units and axes.
// FAILED_PRECONDITION: the format cannot hold a camera of the rig, which is named with the reason.
// No writer approximates in silence: what a format shows wrong by more than kHeldWithinPx anywhere
// in the image is refused.

namespace rigcal {

using ExportFiles = absl::StatusOr<std::vector<ExportFile>>;

ExportFiles WriteOpenCvYaml(const ExportedRig& rig);
ExportFiles WriteKalibr(const ExportedRig& rig);
ExportFiles WriteRos(const ExportedRig& rig);
ExportFiles WriteColmapText(const ExportedRig& rig);
ExportFiles WriteColmapBinary(const ExportedRig& rig);
ExportFiles WriteNerfstudio(const ExportedRig& rig);
ExportFiles WriteAnipose(const ExportedRig& rig);
ExportFiles WritePose2Sim(const ExportedRig& rig);
ExportFiles WriteCaliscope(const ExportedRig& rig);
ExportFiles WriteMcap(const ExportedRig& rig);
ExportFiles WriteMrcal(const ExportedRig& rig);
ExportFiles WriteOpenMvg(const ExportedRig& rig);
ExportFiles WriteMatlab(const ExportedRig& rig);
ExportFiles WriteBlender(const ExportedRig& rig);
ExportFiles WriteUsd(const ExportedRig& rig);

}  // namespace rigcal
