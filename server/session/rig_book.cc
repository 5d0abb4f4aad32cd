// SPDX-License-Identifier: Apache-2.0
#include "server/session/rig_book.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/status/status_macros.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {
namespace {

constexpr int kMaxHistory = 1000;

std::vector<std::string> CameraNames(const Calibration& calibration) {
  std::vector<std::string> names;
  if (!calibration.result) return names;
  for (const CalibratedCamera& camera : calibration.result->cameras) {
    names.push_back(camera.camera);
  }
  return names;
}

// Never, not even by force.
absl::Status CheckUsable(const Calibration& calibration) {
  const std::string name = absl::StrCat("calibration ", calibration.id, " cannot become active: ");
  if (calibration.state != CalibrationState::kSucceeded || !calibration.result) {
    return absl::FailedPreconditionError(
        absl::StrCat(name, calibration.state == CalibrationState::kFailed
                               ? absl::StrCat("it failed (", calibration.error, ")")
                           : calibration.state == CalibrationState::kCancelled
                               ? std::string("it was cancelled")
                               : std::string("it has not ended yet; wait for it")));
  }
  if (calibration.options.what_if) {
    return absl::FailedPreconditionError(absl::StrCat(
        name, "it is a what-if, made to be looked at; calibrate without what-if options"));
  }
  return absl::OkStatus();
}

// Why it must be forced; empty: it need not be.
std::string DoubtOf(const Calibration& calibration, const Calibration* active) {
  const Quality& quality = calibration.result->quality;
  if (quality.grade == QualityGrade::kBad) {
    return absl::StrFormat("it is graded bad (predicted error %.1f mm, %.1f mm is acceptable%s)",
                           1e3 * quality.predicted_error_m, 1e3 * quality.accepted_error_m,
                           quality.reasons.empty() ? "" : "; " + quality.reasons.front());
  }
  if (active == nullptr) return "";
  const std::vector<std::string> own = CameraNames(calibration), others = CameraNames(*active);
  std::vector<std::string> missing, added;
  std::ranges::set_difference(others, own, std::back_inserter(missing));
  std::ranges::set_difference(own, others, std::back_inserter(added));
  // A camera that joined the active rig is no other rig.
  const bool joins = missing.empty() && calibration.options.parent_id == active->id &&
                     calibration.options.kind == SolveKind::kRepair;
  if (joins || (missing.empty() && added.empty())) return "";
  std::string doubt = absl::StrCat("it has other cameras than ", active->id, ", the active one:");
  if (!missing.empty()) absl::StrAppend(&doubt, " without ", absl::StrJoin(missing, ", "));
  if (!added.empty()) {
    absl::StrAppend(&doubt, missing.empty() ? " with " : ", with ", absl::StrJoin(added, ", "));
  }
  return doubt;
}

// The calibrations that were active, a rollback taking the last one away again.
std::vector<std::string> StackOf(const std::vector<Activation>& newest_first) {
  std::vector<std::string> stack;
  for (auto activation = newest_first.rbegin(); activation != newest_first.rend(); ++activation) {
    const std::string& id = activation->calibration_id;
    if (activation->rollback) {
      while (!stack.empty() && stack.back() != id) stack.pop_back();
    }
    if (stack.empty() || stack.back() != id) stack.push_back(id);
  }
  return stack;
}

}  // namespace

RigBook::RigBook(Store* store, std::function<int64_t()> utc_now_ns)
    : store_(store), utc_now_ns_(std::move(utc_now_ns)) {}

absl::StatusOr<Activation> RigBook::Active(std::string_view rig) const {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<Activation> latest, store_->ListActivations(rig, 1));
  return latest.empty() ? Activation() : latest.front();
}

absl::StatusOr<RigState> RigBook::StateOf(const RigSummary& summary) const {
  RigState state{summary, {}, {}};
  RIGCAL_ASSIGN_OR_RETURN(state.activation, Active(summary.name));
  if (state.activation.calibration_id.empty()) return state;
  RIGCAL_ASSIGN_OR_RETURN(const Calibration active,
                          store_->GetCalibration(state.activation.calibration_id));
  state.cameras = CameraNames(active);
  return state;
}

absl::StatusOr<std::vector<RigState>> RigBook::ListRigs() const {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<RigSummary> summaries, store_->ListRigs());
  std::vector<RigState> rigs;
  for (const RigSummary& summary : summaries) {
    RIGCAL_ASSIGN_OR_RETURN(RigState state, StateOf(summary));
    rigs.push_back(std::move(state));
  }
  return rigs;
}

absl::StatusOr<RigState> RigBook::GetRig(std::string_view name) const {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<RigSummary> summaries, store_->ListRigs());
  const auto found = std::ranges::find(summaries, name, &RigSummary::name);
  if (found != summaries.end()) return StateOf(*found);
  std::vector<std::string> names;
  for (const RigSummary& summary : summaries) names.push_back(summary.name);
  return absl::NotFoundError(absl::StrCat(
      "no rig '", std::string(name), "'; there ",
      names.empty()
          ? std::string("is none yet: a rig comes with its first session")
          : absl::StrCat(names.size() == 1 ? "is " : "are ", absl::StrJoin(names, ", "))));
}

absl::StatusOr<std::vector<Activation>> RigBook::History(std::string_view rig) const {
  RIGCAL_RETURN_IF_ERROR(GetRig(rig).status());
  return store_->ListActivations(rig, kMaxHistory);
}

absl::StatusOr<Activation> RigBook::Add(const Calibration& calibration, const Activation& before,
                                        const ActivationRequest& request, bool rollback) {
  RIGCAL_RETURN_IF_ERROR(CheckUsable(calibration));
  std::string doubt;
  if (before.calibration_id.empty()) {
    doubt = DoubtOf(calibration, nullptr);
  } else {
    RIGCAL_ASSIGN_OR_RETURN(const Calibration active,
                            store_->GetCalibration(before.calibration_id));
    doubt = DoubtOf(calibration, &active);
  }
  if (!doubt.empty() && !request.force) {
    return absl::FailedPreconditionError(
        absl::StrCat("calibration ", calibration.id, " was not made active: ", doubt,
                     "; with --force it is made active nevertheless"));
  }
  Activation activation;
  activation.rig = calibration.rig;
  activation.calibration_id = calibration.id;
  activation.version = calibration.version;
  activation.previous_calibration_id = before.calibration_id;
  activation.utc_ns = UtcNowNs(utc_now_ns_);
  activation.operator_name = request.operator_name;
  activation.reason = request.reason;
  activation.forced = !doubt.empty();
  activation.rollback = rollback;
  RIGCAL_ASSIGN_OR_RETURN(activation, store_->AddActivation(std::move(activation)));
  spdlog::info("rig {}: calibration {} is active{}", activation.rig, activation.calibration_id,
               rollback ? " again" : "");
  return activation;
}

absl::StatusOr<Activation> RigBook::Activate(std::string_view calibration_id,
                                             const ActivationRequest& request) {
  RIGCAL_ASSIGN_OR_RETURN(const Calibration calibration, store_->GetCalibration(calibration_id));
  RIGCAL_ASSIGN_OR_RETURN(const Activation before, Active(calibration.rig));
  if (before.calibration_id == calibration.id) return before;
  return Add(calibration, before, request, /*rollback=*/false);
}

absl::StatusOr<Activation> RigBook::Rollback(std::string_view rig,
                                             const ActivationRequest& request) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<Activation> history, History(rig));
  const std::vector<std::string> stack = StackOf(history);
  if (stack.size() < 2) {
    return absl::FailedPreconditionError(absl::StrCat(
        "rig '", std::string(rig), "' cannot be rolled back: ",
        stack.empty() ? "no calibration of it is active"
                      : absl::StrCat("no calibration was active before ", stack.back())));
  }
  const std::string& target = stack[stack.size() - 2];
  const absl::StatusOr<Calibration> calibration = store_->GetCalibration(target);
  if (absl::IsNotFound(calibration.status())) {
    return absl::FailedPreconditionError(absl::StrCat(
        "rig '", std::string(rig), "' cannot be rolled back: calibration ", target,
        ", which was active before ", stack.back(), ", has been deleted; activate another one"));
  }
  RIGCAL_RETURN_IF_ERROR(calibration.status());
  return Add(*calibration, history.front(), request, /*rollback=*/true);
}

}  // namespace rigcal::server
