// SPDX-License-Identifier: Apache-2.0
#include "server/session/calibration_request.h"

#include <algorithm>
#include <cstddef>
#include <set>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/session/derivation_checks.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxSessions = 64;  // of one calibration

absl::Status AddContinuedSessions(const Store& store, std::vector<std::string>* session_ids) {
  for (size_t i = 0; i < session_ids->size() && session_ids->size() < kMaxSessions; ++i) {
    RIGCAL_ASSIGN_OR_RETURN(const Session session, store.GetSession((*session_ids)[i]));
    const std::string& earlier = session.continues;
    if (earlier.empty() || std::ranges::find(*session_ids, earlier) != session_ids->end()) continue;
    // One that was deleted or thrown away meanwhile leaves the rest as it is.
    const absl::StatusOr<Session> found = store.GetSession(earlier);
    if (absl::IsNotFound(found.status())) continue;
    RIGCAL_RETURN_IF_ERROR(found.status());
    if (found->discard_utc_ns != 0) continue;
    session_ids->push_back(earlier);
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckNamedSessions(absl::Span<const std::string> session_ids,
                                const CalibrationOptions& options) {
  const bool solves = !ChangesFrameOnly(options.kind);
  if (session_ids.empty() && solves) {
    return absl::InvalidArgumentError("session_ids is empty; name at least one finished session");
  }
  if (session_ids.size() > 1 && !solves) {
    return absl::InvalidArgumentError(
        absl::StrCat("session_ids names ", session_ids.size(),
                     " sessions; a frame or scale is made from the rows of one"));
  }
  if (session_ids.size() > kMaxSessions) {
    return absl::InvalidArgumentError(absl::StrCat("session_ids names ", session_ids.size(),
                                                   " sessions; at most ", kMaxSessions,
                                                   " are allowed"));
  }
  std::set<std::string_view> distinct;
  for (const std::string& id : session_ids) {
    if (!distinct.insert(id).second) {
      return absl::InvalidArgumentError(absl::StrCat("session_ids names '", id, "' twice"));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<std::string>> SessionsToUse(const Store& store,
                                                       std::vector<std::string> session_ids,
                                                       CalibrationOptions* options) {
  const bool solves = !ChangesFrameOnly(options->kind);
  // A repair is of what was recorded after the move: the sessions that are named.
  if (solves && options->kind != SolveKind::kRepair) {
    RIGCAL_RETURN_IF_ERROR(AddContinuedSessions(store, &session_ids));
  }
  std::erase_if(session_ids, [options](const std::string& id) {
    return std::ranges::find(options->without_sessions, id) != options->without_sessions.end();
  });
  if (session_ids.empty() && solves) {
    return absl::InvalidArgumentError("without_sessions leaves no session");
  }
  options->without_sessions.clear();  // done
  return session_ids;
}

absl::Status ChooseFrame(const Store& store, const std::string& rig, CalibrationOptions* options) {
  // What only looks, such as a monitor, needs no frame.
  const bool by_default = options->frame == FrameChoice::kDefault && !options->what_if;
  const bool keeps =
      options->frame == FrameChoice::kKeep || options->frame == FrameChoice::kKeepIfPossible;
  if (options->kind != SolveKind::kFull || !options->parent_id.empty() || !(by_default || keeps)) {
    return absl::OkStatus();
  }
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<Activation> latest, store.ListActivations(rig, 1));
  const absl::StatusOr<Calibration> active =
      latest.empty() ? absl::NotFoundError("no calibration of it is active")
                     : store.GetCalibration(latest.front().calibration_id);
  if (keeps) {
    if (active.ok()) options->parent_id = active->id;
    if (active.ok() || options->frame == FrameChoice::kKeepIfPossible) return absl::OkStatus();
    return absl::FailedPreconditionError(
        absl::StrCat("there is no frame of rig '", rig,
                     "' to keep: ", std::string(active.status().message()), "; name a parent"));
  }
  if (!active.ok() || !active->result || !active->result->frame ||
      !active->result->frame->IsOwn()) {
    return absl::OkStatus();
  }
  options->frame = FrameChoice::kKeepIfPossible;
  options->parent_id = active->id;
  return absl::OkStatus();
}

absl::StatusOr<std::optional<Calibration>> ParentOf(const Store& store,
                                                    const CalibrationOptions& options) {
  if (!options.NeedsParent()) return std::nullopt;
  absl::StatusOr<Calibration> parent = store.GetCalibration(options.parent_id);
  // Its frame cannot be kept then, and the result says so.
  if (!parent.ok() && options.frame == FrameChoice::kKeepIfPossible) return std::nullopt;
  RIGCAL_RETURN_IF_ERROR(parent.status());
  // Not needed by a solve, and large.
  if (parent->result && !ChangesFrameOnly(options.kind)) parent->result->residuals.clear();
  return std::optional<Calibration>(*std::move(parent));
}

absl::Status Derive(const Store& store, absl::Span<const Session> sessions,
                    Calibration* calibration) {
  const CalibrationOptions& options = calibration->options;
  if (options.parent_id.empty()) {
    calibration->held = HeldBy(options, sessions, nullptr);
    return CheckDerivation(options, sessions, nullptr);
  }
  RIGCAL_ASSIGN_OR_RETURN(const Calibration parent, store.GetCalibration(options.parent_id));
  calibration->held = HeldBy(options, sessions, &parent);
  return CheckDerivation(options, sessions, &parent);
}

}  // namespace rigcal::server
