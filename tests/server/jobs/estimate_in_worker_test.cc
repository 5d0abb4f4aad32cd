// SPDX-License-Identifier: Apache-2.0
// Running estimates in real rigcal-worker processes.
#include "server/jobs/estimate_in_worker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::server::estimate_in_worker_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

EstimateTask Task(const std::string& simulation = "cameras=3;rate=25;duration=10;seed=2") {
  const auto options = testing::ParseSimulationOptions(simulation);
  const auto world = SimulatedWorld::Create(*options, WandTarget());
  EstimateTask task;
  task.target = WandTarget();
  for (CameraTrack& track : InputOf(*world).tracks) {
    ObservationBatch batch;
    batch.stream = {track.session_id, track.camera.camera, 1};
    batch.marker_count = 3;
    for (const Observation& row : track.observations) batch.Append(row);
    track.observations.clear();
    task.tracks.push_back(std::move(track));
    task.rows.push_back({std::move(batch)});
  }
  return task;
}

EstimateWorkerOptions Options() {
  EstimateWorkerOptions options;
  options.program = std::filesystem::path(RIGCAL_BIN_DIR) / "rigcal-worker";
  return options;
}

TEST(EstimateInWorker, GivesWhatThisProcessGives) {
  const std::atomic<bool> cancelled = false;
  ASSERT_OK_AND_ASSIGN(const RunningOutcome here, EstimateInProcess()(Task(), cancelled));
  ASSERT_OK_AND_ASSIGN(const RunningOutcome there, EstimateInWorker(Options())(Task(), cancelled));
  ASSERT_TRUE(here.estimate) << here.problem;
  ASSERT_TRUE(there.estimate) << there.problem;
  EXPECT_EQ(here.estimate->error.p95_m, there.estimate->error.p95_m);
  EXPECT_EQ(here.estimate->cameras[2].cam_from_rig.translation_m,
            there.estimate->cameras[2].cam_from_rig.translation_m);
}

TEST(EstimateInWorker, GoesOnFromTheLastOne) {
  const std::atomic<bool> cancelled = false;
  const EstimateFunction estimate = EstimateInWorker(Options());
  ASSERT_OK_AND_ASSIGN(const RunningOutcome first, estimate(Task(), cancelled));
  ASSERT_TRUE(first.estimate);
  EstimateTask task = Task();
  task.start = first.estimate->next;
  ASSERT_OK_AND_ASSIGN(const RunningOutcome second, estimate(std::move(task), cancelled));
  ASSERT_TRUE(second.estimate) << second.problem;
  EXPECT_EQ(second.estimate->next.round, 2);
}

TEST(EstimateInWorker, SaysThatItsMemoryIsTooLittle) {
  EstimateWorkerOptions options = Options();
  options.memory_bytes = 1 << 20;
  const std::atomic<bool> cancelled = false;
  // Rows of more than what a worker has at hand when it starts.
  EXPECT_THAT(
      EstimateInWorker(options)(Task("cameras=6;rate=50;duration=40;seed=2"), cancelled).status(),
      StatusIs(absl::StatusCode::kResourceExhausted, ::testing::_));
}

TEST(EstimateInWorker, IsCancelled) {
  const std::atomic<bool> cancelled = true;
  EXPECT_THAT(EstimateInWorker(Options())(Task(), cancelled).status(),
              StatusIs(absl::StatusCode::kCancelled, ::testing::_));
}

// A program of the shell in place of the worker.
class FakeEstimateWorker {
 public:
  explicit FakeEstimateWorker(const std::string& commands) {
    std::ofstream(file()) << "#!/bin/sh\n" << commands << "\n";
    std::filesystem::permissions(file(), std::filesystem::perms::owner_all);
  }
  std::filesystem::path file() const { return directory_.path() / "worker.sh"; }

 private:
  ::rigcal::testing::TemporaryDirectory directory_;
};

TEST(EstimateInWorker, WithoutASignOfLifeItIsEnded) {
  const FakeEstimateWorker worker("exec sleep 600");
  EstimateWorkerOptions options = Options();
  options.program = worker.file();
  options.silence_limit = std::chrono::milliseconds(1000);
  const std::atomic<bool> cancelled = false;
  EXPECT_THAT(EstimateInWorker(options)(Task(), cancelled).status(),
              StatusIs(absl::StatusCode::kDeadlineExceeded, HasSubstr("no sign of life for 1 s")));
}

TEST(EstimateInWorker, AtWorkForTooLongItIsEnded) {
  // EstimateOutput with a heartbeat.
  const FakeEstimateWorker worker(
      "while true; do sleep 0.1; printf '\\002\\000\\000\\000\\062\\000'; done");
  EstimateWorkerOptions options = Options();
  options.program = worker.file();
  options.time_limit = std::chrono::milliseconds(1000);
  const std::atomic<bool> cancelled = false;
  EXPECT_THAT(EstimateInWorker(options)(Task(), cancelled).status(),
              StatusIs(absl::StatusCode::kDeadlineExceeded, HasSubstr("took more than 1 s")));
}

TEST(EstimateInWorker, AProgramThatIsNoWorkerIsAFailure) {
  EstimateWorkerOptions options = Options();
  options.program = "/bin/true";
  const std::atomic<bool> cancelled = false;
  const absl::Status status = EstimateInWorker(options)(Task(), cancelled).status();
  EXPECT_THAT(status, StatusIs(absl::StatusCode::kInternal, ::testing::_));
  EXPECT_THAT(std::string(status.message()), HasSubstr("without a result"));
}

}  // namespace
}  // namespace rigcal::server::estimate_in_worker_test
