// SPDX-License-Identifier: Apache-2.0
#include "tests/server/session/runner_fixture.h"

#include <chrono>
#include <utility>

#include "tests/server/session/change_waiter.h"

namespace rigcal::testing {

server::CalibrateFunction ScriptedSolver::Function() {
  return [this](const server::CalibrationInput& input, const CalibrationOptions&,
                const server::CalibrationHooks& hooks) { return Solve(input, hooks); };
}

server::CalibrationOutcome ScriptedSolver::Solve(const server::CalibrationInput& input,
                                                 const server::CalibrationHooks& hooks) {
  std::function<void(const server::CalibrationHooks&)> body;
  {
    std::unique_lock lock(mutex_);
    ++begun_;
    last_input_ = input;
    body = body_;
    changed_.notify_all();
    // Polls for cancellation, as a solver does.
    while (held_ && !*hooks.cancelled) changed_.wait_for(lock, std::chrono::milliseconds(1));
  }
  if (body) body(hooks);
  std::lock_guard lock(mutex_);
  if (*hooks.cancelled) return {absl::CancelledError("cancelled"), {}};
  if (result_.ok()) {
    CalibrationResult result = *result_;
    result.refused = input.refused;
    result.target.given = input.target;
    return {std::move(result), input.refused};
  }
  return {result_, refused_};
}

void ScriptedSolver::Hold() {
  std::lock_guard lock(mutex_);
  held_ = true;
}

void ScriptedSolver::Release() {
  std::lock_guard lock(mutex_);
  held_ = false;
  changed_.notify_all();
}

void ScriptedSolver::AwaitBegun(int count) {
  std::unique_lock lock(mutex_);
  EXPECT_TRUE(changed_.wait_for(lock, std::chrono::seconds(60), [&] { return begun_ >= count; }));
}

void ScriptedSolver::SetOutcome(absl::StatusOr<CalibrationResult> result,
                                std::vector<Refusal> refused) {
  std::lock_guard lock(mutex_);
  result_ = std::move(result);
  refused_ = std::move(refused);
}

void ScriptedSolver::SetBody(std::function<void(const server::CalibrationHooks&)> body) {
  std::lock_guard lock(mutex_);
  body_ = std::move(body);
}

server::CalibrationInput ScriptedSolver::last_input() const {
  std::lock_guard lock(mutex_);
  return last_input_;
}

void RunnerFixture::SetUp() {
  SessionFixture::SetUp();
  OpenRunner();
}

void RunnerFixture::TearDown() {
  solver_.Release();
  runner_.reset();
  SessionFixture::TearDown();
}

void RunnerFixture::OpenRunner() {
  ASSERT_OK_AND_ASSIGN(
      runner_, server::CalibrationRunner::Create(runner_options_, faulty_.get(), coordinator_.get(),
                                                 server::SolveInProcess(solver_.Function())));
  runner_->Start();
}

void RunnerFixture::RestartAll() {
  runner_.reset();
  Restart();
  OpenRunner();
}

Calibration RunnerFixture::AwaitEnd(const std::string& id) {
  ChangeWaiter changes;
  const auto watch = runner_->WatchCalibration(id, changes.Wake());
  EXPECT_THAT(watch, IsOk());
  const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (watch.ok() && std::chrono::steady_clock::now() < limit) {
    auto calibration = runner_->GetCalibration(id);
    EXPECT_THAT(calibration, IsOk());
    if (!calibration.ok()) return {};
    if (HasEnded(calibration->state)) {
      return *std::move(calibration);
    }
    changes.Wait(std::chrono::milliseconds(1000));
  }
  ADD_FAILURE() << "calibration " << id << " does not end";
  return {};
}

}  // namespace rigcal::testing
