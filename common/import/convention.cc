// SPDX-License-Identifier: Apache-2.0
#include "common/import/convention.h"

#include <Eigen/QR>

#include "absl/strings/str_cat.h"
#include "common/camera/camera_model.h"

namespace rigcal {
namespace {

// The least-squares point of the optical axes, slightly drawn to the cameras so that parallel axes
// have one, too.
Eigen::Vector3d NearestToAxes(std::span<const ImportedCamera> cameras) {
  constexpr double kDraw = 1e-9;
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const ImportedCamera& camera : cameras) {
    if (!camera.cam_from_rig) continue;
    const Eigen::Vector3d centre = camera.cam_from_rig->SourceFromTargetTranslation();
    const Eigen::Vector3d axis =
        camera.cam_from_rig->rotation.conjugate() * Eigen::Vector3d::UnitZ();
    const Eigen::Matrix3d across =
        (1 + kDraw) * Eigen::Matrix3d::Identity() - axis * axis.transpose();
    a += across;
    b += across * centre;
  }
  return a.completeOrthogonalDecomposition().solve(b);
}

bool Sees(const ImportedCamera& camera, const Eigen::Vector3d& x_in_rig) {
  Eigen::Vector2d pixel;
  if (!Project(camera.intrinsics, *camera.cam_from_rig * x_in_rig, &pixel)) return false;
  return pixel.x() > -0.5 && pixel.x() < camera.image_size_px.width - 0.5 && pixel.y() > -0.5 &&
         pixel.y() < camera.image_size_px.height - 0.5;
}

}  // namespace

int CountLookingTogether(std::span<const ImportedCamera> cameras) {
  const Eigen::Vector3d point = NearestToAxes(cameras);
  int count = 0;
  for (const ImportedCamera& camera : cameras) {
    if (camera.cam_from_rig && Sees(camera, point)) ++count;
  }
  return count;
}

std::vector<ImportedCamera> ChooseReading(std::vector<PoseReading> readings, std::string* note) {
  const auto documented = CountLookingTogether(readings.front().cameras);
  size_t best = 0;
  int best_count = documented;
  for (size_t i = 1; i < readings.size(); ++i) {
    const int count = CountLookingTogether(readings[i].cameras);
    if (count > best_count) best = i, best_count = count;
  }
  const size_t total = readings.front().cameras.size();
  // With two cameras or fewer, or where half of them look together anyhow, nothing is clear.
  const bool clear = total >= 3 && best_count * 3 > static_cast<int>(total) * 2 &&
                     documented * 2 <= static_cast<int>(total);
  if (!clear) return std::move(readings.front().cameras);
  *note = absl::StrCat(
      "read as documented (", readings.front().meaning, "), ", documented, " of ", total,
      " cameras see the point that all look at; it was read in another way (",
      readings[best].meaning, "), with which ", best_count, " do. Compare before you use it");
  return std::move(readings[best].cameras);
}

std::vector<PoseReading> CommonReadings(const std::vector<ImportedCamera>& cameras) {
  const RigidTransform flip(Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d::Zero());
  std::vector<PoseReading> readings = {
      {"poses take the rig to a camera that looks along z", cameras},
      {"poses take a camera that looks along z to the rig", cameras},
      {"poses take a camera that looks along -z to the rig", cameras},
      {"poses take the rig to a camera that looks along -z", cameras}};
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (!cameras[i].cam_from_rig) continue;
    const RigidTransform& pose = *cameras[i].cam_from_rig;
    readings[1].cameras[i].cam_from_rig = pose.Inverse();
    readings[2].cameras[i].cam_from_rig = flip * pose.Inverse();
    readings[3].cameras[i].cam_from_rig = flip * pose;
  }
  return readings;
}

void RecogniseConvention(ImportedRig* rig) {
  for (const ImportedCamera& camera : rig->cameras) {
    if (!camera.cam_from_rig) return;
  }
  std::string note;
  rig->cameras = ChooseReading(CommonReadings(rig->cameras), &note);
  if (!note.empty()) rig->notes.push_back(note);
}

}  // namespace rigcal
