// SPDX-License-Identifier: Apache-2.0
#include "server/monitor/camera_repairs.h"

#include <spdlog/spdlog.h>

#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "server/monitor/look_result.h"

namespace rigcal::server {
namespace {

constexpr char kOperator[] = "monitor";

std::string MovedText(const std::vector<std::string>& cameras) {
  return absl::StrCat(absl::StrJoin(cameras, ", "), cameras.size() == 1 ? " has" : " have",
                      " moved");
}

std::string_view GradeText(QualityGrade grade) {
  return grade == QualityGrade::kBad      ? "bad"
         : grade == QualityGrade::kUsable ? "usable only"
                                          : "not evaluated";
}

}  // namespace

CameraRepairs::CameraRepairs(CameraRepairsOptions options, Store* store, CalibrationRunner* runner,
                             AuditLog* audit)
    : options_(std::move(options)),
      store_(store),
      runner_(runner),
      audit_(audit),
      book_(store, options_.utc_now_ns) {}

std::optional<CameraRepair> CameraRepairs::Begin(const std::string& rig, const Session& session,
                                                 double clean_from_s, double duration_s,
                                                 LiveMonitor* shown) {
  CameraRepair repair;
  repair.parent_id = shown->calibration_id;
  for (const LiveMonitoredCamera& camera : shown->cameras) {
    // A verdict of before is of another session.
    if (camera.verdict == MonitorVerdict::kMoved && camera.time_utc_ns >= session.start_utc_ns) {
      repair.cameras.push_back(camera.camera);
    }
  }
  if (repair.cameras.empty() || shown->all_moved) return std::nullopt;
  const std::string moved = MovedText(repair.cameras);
  const auto refuse = [&](const std::string& why) {
    shown->repair = MonitorRepairState::kNotActive;
    shown->repair_id.clear();
    shown->repair_text = absl::StrCat(moved, ", and is not repaired: ", why);
    Audit(rig, repair, shown->repair_text);
    return std::nullopt;
  };
  // By the wall clock, by which it was seen to move: a recording may come faster than it was made.
  if (clean_from_s > 0 && duration_s - clean_from_s < options_.least_repair_s) {
    return refuse("too little was recorded after the move; wave for ten seconds more");
  }
  CalibrationOptions options;
  options.kind = SolveKind::kRepair;
  options.parent_id = repair.parent_id;
  options.only_cameras = repair.cameras;
  options.from_s = clean_from_s;
  const absl::StatusOr<Calibration> created = runner_->CreateCalibration(
      {session.id}, options,
      {.operator_name = kOperator, .reason = absl::StrCat("monitor: ", moved), .notes = ""});
  if (!created.ok()) return refuse(std::string(created.status().message()));
  repair.id = created->id;
  shown->repair = MonitorRepairState::kSolving;
  shown->repair_id = repair.id;
  shown->repair_text = absl::StrCat(moved, "; calibration ", repair.id, " repairs it");
  Audit(rig, repair, shown->repair_text);
  return repair;
}

bool CameraRepairs::Follow(const std::string& rig, const CameraRepair& repair, LiveMonitor* shown) {
  const absl::StatusOr<Calibration> calibration = runner_->GetCalibration(repair.id);
  if (calibration.ok() && !HasEnded(calibration->state)) return false;
  if (calibration.ok()) {
    End(rig, repair, *calibration, shown);
  } else {
    shown->repair = MonitorRepairState::kNotActive;
    shown->repair_text = std::string(calibration.status().message());
  }
  Audit(rig, repair, shown->repair_text);
  return true;
}

void CameraRepairs::End(const std::string& rig, const CameraRepair& repair,
                        const Calibration& calibration, LiveMonitor* shown) {
  const std::string moved = MovedText(repair.cameras);
  const auto leave = [&](const std::string& why) {
    shown->repair = MonitorRepairState::kNotActive;
    shown->repair_text =
        absl::StrCat(moved, "; the repair ", calibration.id, " was not made active: ", why);
  };
  if (calibration.state != CalibrationState::kSucceeded) return leave(calibration.error);
  const CalibrationResult& result = *calibration.result;
  if (!MovedWithin(result).empty()) {
    return leave("cameras moved while it was recorded; wave for ten seconds more");
  }
  if (result.quality.grade != QualityGrade::kGood) {
    return leave(absl::StrCat("it is graded ", std::string(GradeText(result.quality.grade)),
                              result.quality.reasons.empty() ? "" : ", ",
                              result.quality.reasons.empty() ? "" : result.quality.reasons.front(),
                              "; look at it, or calibrate the whole rig"));
  }
  const auto latest = store_->ListActivations(rig, 1);
  if (!latest.ok() || latest->empty() || latest->front().calibration_id != repair.parent_id) {
    return leave(absl::StrCat("calibration ", repair.parent_id,
                              ", which it repairs, is not the active one any more"));
  }
  const absl::StatusOr<Activation> activated = book_.Activate(
      calibration.id, {.operator_name = kOperator, .reason = absl::StrCat("monitor: ", moved)});
  if (!activated.ok()) return leave(std::string(activated.status().message()));
  shown->repair = MonitorRepairState::kActive;
  shown->repair_text = absl::StrCat(moved, "; calibration ", calibration.id,
                                    " repairs it and is the active one now; `rigcal rig rollback ",
                                    rig, "` takes that back");
}

void CameraRepairs::Audit(const std::string& rig, const CameraRepair& repair,
                          const std::string& what) const {
  spdlog::info("monitor of rig {}: {}", rig, what);
  if (audit_ == nullptr) return;
  audit_->WriteChange("monitor", "this server",
                      {{"rig", rig},
                       {"parent", repair.parent_id},
                       {"calibration", repair.id},
                       {"cameras", absl::StrJoin(repair.cameras, ", ")},
                       {"message", what}});
}

}  // namespace rigcal::server
