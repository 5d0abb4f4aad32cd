// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/session/calibration_runner.h"
#include "tests/server/session/session_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing {

// A solver under the control of a test. After Hold it stays in the solve until Release or until it
// is cancelled.
class ScriptedSolver {
 public:
  server::CalibrateFunction Function();
  // The next solves wait for Release or for their cancellation.
  void Hold();
  void Release();
  // Waits until `count` solves have begun in all.
  void AwaitBegun(int count);
  // The result of a solve.
  void SetOutcome(absl::StatusOr<CalibrationResult> result, std::vector<Refusal> refused = {});
  // Runs in the solve, before it returns.
  void SetBody(std::function<void(const server::CalibrationHooks&)> body);
  server::CalibrationInput last_input() const;

 private:
  server::CalibrationOutcome Solve(const server::CalibrationInput& input,
                                   const server::CalibrationHooks& hooks);

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  bool held_ = false;
  int begun_ = 0;
  absl::StatusOr<CalibrationResult> result_ = CalibrationResult{};
  std::vector<Refusal> refused_;
  std::function<void(const server::CalibrationHooks&)> body_;
  server::CalibrationInput last_input_;
};

class RunnerFixture : public SessionFixture {
 protected:
  void SetUp() override;
  void TearDown() override;
  void OpenRunner();
  // As after kill -9 of a server that had `calibration` in this state.
  void RestartAll();
  // Watches until it has ended.
  Calibration AwaitEnd(const std::string& id);
  server::CalibrationRunner& runner() { return *runner_; }

  server::CalibrationRunnerOptions runner_options_;
  ScriptedSolver solver_;
  std::unique_ptr<server::CalibrationRunner> runner_;
};

}  // namespace rigcal::testing
