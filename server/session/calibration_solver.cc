// SPDX-License-Identifier: Apache-2.0
#include "server/session/calibration_solver.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "server/session/calibration_input.h"

namespace rigcal::server {

CalibrationOutcome CannotRead(const absl::Status& status, const RefusalCounter& refused) {
  return {absl::Status(status.code(),
                       absl::StrCat("the observations cannot be read: ", status.message())),
          refused.List(), absl::IsUnavailable(status)};
}

SolveFunction SolveInProcess(CalibrateFunction calibrate) {
  return [calibrate = std::move(calibrate)](const SolveTask& task, const CalibrationHooks& hooks) {
    RefusalCounter refused;
    std::vector<RowShare> shares;
    absl::StatusOr<CalibrationInput> input = ReadCalibrationInput(
        task.store, task.session_ids, task.max_observations, *hooks.cancelled, &refused, &shares);
    if (!input.ok()) return CannotRead(input.status(), refused);
    if (task.parent != nullptr) input->parent = task.parent->result;
    // Without sessions there is no target of theirs.
    if (task.session_ids.empty() && input->parent) input->target = input->parent->target.given;
    CalibrationOutcome outcome = calibrate(*input, task.options, hooks);
    if (outcome.result.ok()) NoteIncompleteSessions(shares, task.options, &*outcome.result);
    return outcome;
  };
}

}  // namespace rigcal::server
