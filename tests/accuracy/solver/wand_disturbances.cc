// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Core>
#include <string>
#include <utility>

#include "tests/accuracy/solver/disturbance.h"
#include "tests/accuracy/solver/wand_from_one_view.h"

namespace rigcal::accuracy {
namespace {

Disturbance OfWand(const std::string& name, std::function<void(double, WandInCamera*)> change) {
  return {name,  {FindingKind::kWandNotRigid},
          "",    false,
          false, [change](uint32_t, DoctorPatient* patient) { ChangeWand(change, patient); }};
}

Eigen::Vector3d Along(const WandInCamera& wand) { return (wand[2] - wand[0]).normalized(); }

// Of `down` in the rig, what is across the wand.
Eigen::Vector3d Across(const WandInCamera& wand, const Eigen::Vector3d& down) {
  const Eigen::Vector3d along = Along(wand);
  return down - along.dot(down) * along;
}

}  // namespace

std::vector<Disturbance> WandDisturbances() {
  const Eigen::Vector3d down(0.1, 1, 0.3);
  return {
      OfWand("wand bent by 10 mm",
             [down](double, WandInCamera* wand) {
               (*wand)[1] += 0.01 * Across(*wand, down).normalized();
             }),
      OfWand("wand sags by 6 mm",
             [down](double, WandInCamera* wand) {
               (*wand)[1] += 0.006 * Across(*wand, down.normalized());
             }),
      OfWand("end marker slips 10 mm half-way",
             [](double share, WandInCamera* wand) {
               if (share >= 0.5) (*wand)[2] += 0.01 * Along(*wand);
             }),
      OfWand("middle marker slips 10 mm half-way",
             [](double share, WandInCamera* wand) {
               if (share >= 0.5) (*wand)[1] += 0.01 * Along(*wand);
             }),
      OfWand("end marker slips 5 mm late",
             [](double share, WandInCamera* wand) {
               if (share >= 0.8) (*wand)[2] += 0.005 * Along(*wand);
             }),
  };
}

}  // namespace rigcal::accuracy
