// SPDX-License-Identifier: Apache-2.0
// Solves in real rigcal-worker processes, and what becomes of a calibration when they fail.
#include "server/jobs/solve_in_worker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/calibration/calibration_record.h"
#include "common/wire/calibration_wire.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::solve_in_worker_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using std::chrono::milliseconds;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

const std::filesystem::path kWorker = std::filesystem::path(RIGCAL_BIN_DIR) / "rigcal-worker";

// Processes named rigcal-worker that this one has started.
std::vector<pid_t> Workers() {
  std::vector<pid_t> workers;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    std::ifstream file(entry.path() / "stat");
    std::string name, state;
    pid_t pid = 0, parent = 0;
    if (file >> pid >> name >> state >> parent && parent == getpid() && name == "(rigcal-worker)" &&
        state != "Z") {
      workers.push_back(pid);
    }
  }
  return workers;
}

class SolveInWorker : public ::rigcal::testing::StoreFixture {
 protected:
  void SetUp() override {
    StoreFixture::SetUp();
    options_.program = kWorker;
    options_.scratch_dir = directory_.path();
  }

  // A finished session with the rows of a simulated rig.
  void Record(const std::string& world_options) {
    ASSERT_OK_AND_ASSIGN(const SimulationOptions options,
                         ::rigcal::testing::ParseSimulationOptions(world_options));
    ASSERT_OK_AND_ASSIGN(const SimulatedWorld world, SimulatedWorld::Create(options, WandTarget()));
    Session session;
    session.id = "wave";
    session.rig = "rig";
    session.target = WandTarget();
    session.state = SessionState::kCapturing;
    for (const SimulatedCamera& camera : world.cameras()) {
      session.cameras.push_back({camera.description, ""});
    }
    ASSERT_THAT(store().CreateSession(session), IsOk());
    for (int c = 0; c < static_cast<int>(world.cameras().size()); ++c) {
      ObservationBatch batch;
      batch.stream = {"wave", world.cameras()[static_cast<size_t>(c)].description.camera, 1};
      batch.marker_count = 3;
      for (int i = 0; i < world.FrameCount(c); ++i) {
        Observation row = world.Observe(c, i, nullptr);
        row.markers.resize(3);
        row.clock_epoch = 0;
        batch.Append(row);
      }
      Append(::rigcal::testing::MakeDelivery(batch));
    }
    session.state = SessionState::kFinished;
    ASSERT_THAT(store().UpdateSession(session), IsOk());
  }

  CalibrationOutcome Solve(const SolveFunction& solve,
                           std::function<void(CalibrationStage, double)> progress = {}) {
    CalibrationHooks hooks;
    hooks.progress = std::move(progress);
    hooks.silence = [this](bool not_responding) {
      silences_.push_back(not_responding);
      if (on_silence_) on_silence_(not_responding);
    };
    hooks.cancelled = &cancelled_;
    return solve({store(), session_ids_, 1'000'000, calibration_options_}, hooks);
  }
  // In a worker; `act` is called with its pid once it solves.
  CalibrationOutcome SolveAnd(const std::function<void(pid_t)>& act) {
    bool done = false;
    return Solve(server::SolveInWorker(options_), [&](CalibrationStage, double) {
      const std::vector<pid_t> workers = Workers();
      if (done || workers.empty()) return;
      done = true;
      act(workers.front());
    });
  }

  // A program of the shell.
  std::filesystem::path Script(const std::string& commands) const {
    const std::filesystem::path file = directory_.path() / "worker.sh";
    std::ofstream(file) << "#!/bin/sh\n" << commands << "\n";
    std::filesystem::permissions(file, std::filesystem::perms::owner_all);
    return file;
  }

  std::string Bytes(const CalibrationOutcome& outcome) {
    Calibration calibration;
    calibration.state = CalibrationState::kSucceeded;
    if (outcome.result.ok()) calibration.result = *outcome.result;
    return wire::SerializeCalibration(calibration);
  }

  const std::vector<std::string> session_ids_ = {"wave"};
  std::atomic<bool> cancelled_ = false;
  CalibrationOptions calibration_options_;
  WorkerOptions options_;
  std::vector<bool> silences_;  // as they were reported
  std::function<void(bool)> on_silence_;
};

TEST_F(SolveInWorker, GivesTheBitsOfASolveInThisProcess) {
  Record("cameras=3;duration=10;rate=50");
  std::vector<CalibrationStage> stages;
  const CalibrationOutcome own = Solve(SolveInProcess(Calibrate));
  const CalibrationOutcome of_worker =
      Solve(server::SolveInWorker(options_), [&](CalibrationStage stage, double) {
        if (stages.empty() || stages.back() != stage) stages.push_back(stage);
      });
  ASSERT_THAT(own.result, IsOk());
  ASSERT_THAT(of_worker.result, IsOk());
  EXPECT_EQ(Bytes(of_worker), Bytes(own));
  EXPECT_EQ(of_worker.refused, own.refused);
  EXPECT_FALSE(of_worker.result->camera_covariance.empty());
  EXPECT_THAT(stages, ::testing::Contains(CalibrationStage::kAdjusting));
  EXPECT_THAT(Workers(), IsEmpty());
  // Nothing is left in the folder but the store.
  for (const auto& entry : std::filesystem::directory_iterator(directory_.path())) {
    EXPECT_EQ(entry.path(), folder());
  }
}

TEST_F(SolveInWorker, FailsWithTheWordsOfASolveInThisProcess) {
  Record("cameras=2;duration=2");
  calibration_options_.reference_camera = "nobody";
  const CalibrationOutcome own = Solve(SolveInProcess(Calibrate));
  const CalibrationOutcome of_worker = Solve(server::SolveInWorker(options_));
  ASSERT_FALSE(own.result.ok());
  EXPECT_EQ(of_worker.result.status(), own.result.status());
  EXPECT_EQ(of_worker.refused, own.refused);
}

TEST_F(SolveInWorker, ItsMemoryLimitEndsItAndIsNamed) {
  Record("cameras=4;duration=20;rate=100");
  options_.max_memory_bytes = 4 << 20;
  EXPECT_THAT(Solve(server::SolveInWorker(options_)).result,
              StatusIs(absl::StatusCode::kResourceExhausted,
                       AllOf(HasSubstr("more than its 4 MiB of memory"),
                             HasSubstr("limits.calibration_memory_mb"))));
}

TEST_F(SolveInWorker, KilledFromOutsideItSaysSo) {
  Record("cameras=4;duration=20");
  EXPECT_THAT(SolveAnd([](pid_t worker) { kill(worker, SIGKILL); }).result,
              StatusIs(absl::StatusCode::kUnavailable,
                       AllOf(HasSubstr("was killed while"), HasSubstr("signal 9"))));
  EXPECT_THAT(Workers(), IsEmpty());
}

TEST_F(SolveInWorker, CrashedItSaysSo) {
  Record("cameras=4;duration=20");
  EXPECT_THAT(SolveAnd([](pid_t worker) { kill(worker, SIGSEGV); }).result,
              StatusIs(absl::StatusCode::kInternal,
                       AllOf(HasSubstr("crashed"), HasSubstr("signal 11, Segmentation fault"))));
}

TEST_F(SolveInWorker, CancelledItEnds) {
  Record("cameras=4;duration=20");
  EXPECT_THAT(SolveAnd([this](pid_t) { cancelled_ = true; }).result,
              StatusIs(absl::StatusCode::kCancelled, HasSubstr("cancelled")));
  EXPECT_THAT(Workers(), IsEmpty());
}

TEST_F(SolveInWorker, HangingItIsEnded) {
  Record("cameras=4;duration=20");
  options_.silence = {.doubt = milliseconds(700), .end = milliseconds(1500)};
  EXPECT_THAT(SolveAnd([](pid_t worker) { kill(worker, SIGSTOP); }).result,
              StatusIs(absl::StatusCode::kDeadlineExceeded, HasSubstr("no sign of life for 1 s")));
  ASSERT_THAT(silences_, Not(IsEmpty()));
  EXPECT_TRUE(silences_.back());
  EXPECT_THAT(Workers(), IsEmpty());
}

TEST_F(SolveInWorker, StoppedForAMomentItIsDoubtedAndGoesOn) {
  Record("cameras=4;duration=20");
  options_.silence = {.doubt = milliseconds(700), .end = std::chrono::seconds(60)};
  on_silence_ = [](bool not_responding) {
    for (const pid_t worker : Workers()) kill(worker, not_responding ? SIGCONT : 0);
  };
  EXPECT_THAT(SolveAnd([](pid_t worker) { kill(worker, SIGSTOP); }).result, IsOk());
  // Under load it may be doubted more than once.
  ASSERT_GE(silences_.size(), 2u);
  EXPECT_TRUE(silences_[0]);
  EXPECT_FALSE(silences_[1]);
}

// Messages of solve.proto: a heartbeat, and progress (stage 5), behind their lengths.
constexpr char kBeat[] = "printf '\\002\\000\\000\\000\\032\\000'";
constexpr char kStep[] = "printf '\\004\\000\\000\\000\\012\\002\\010\\005'";

TEST_F(SolveInWorker, WaitingForEverItIsEnded) {
  Record("cameras=2;duration=1");
  options_.program = Script("exec sleep 600");
  options_.silence = {.doubt = milliseconds(300), .end = milliseconds(1000)};
  EXPECT_THAT(Solve(server::SolveInWorker(options_)).result,
              StatusIs(absl::StatusCode::kDeadlineExceeded, HasSubstr("no sign of life")));
}

TEST_F(SolveInWorker, ALongStageWithoutProgressIsNoHang) {
  Record("cameras=2;duration=1");
  options_.program = Script(absl::StrCat(
      kStep, "; for i in 1 2 3 4 5 6 7 8 9 10 11 12; do sleep 0.25; ", kBeat, "; done; exit 7"));
  options_.silence = {.doubt = milliseconds(1900), .end = milliseconds(2000)};
  EXPECT_THAT(Solve(server::SolveInWorker(options_)).result,
              StatusIs(absl::StatusCode::kInternal, HasSubstr("(code 7)")));
}

TEST_F(SolveInWorker, GoingInCirclesItIsEnded) {
  Record("cameras=2;duration=1");
  options_.program = Script(absl::StrCat("while true; do sleep 0.1; ", kBeat, "; done"));
  options_.silence = {.doubt = std::chrono::seconds(30),
                      .end = std::chrono::seconds(60),
                      .stuck = milliseconds(1000)};
  EXPECT_THAT(Solve(server::SolveInWorker(options_)).result,
              StatusIs(absl::StatusCode::kDeadlineExceeded, HasSubstr("got no further for 1 s")));
}

TEST_F(SolveInWorker, ProgramsThatAreNoWorkerAreFailures) {
  Record("cameras=2;duration=1");
  options_.program = "/bin/true";
  EXPECT_THAT(Solve(server::SolveInWorker(options_)).result,
              StatusIs(absl::StatusCode::kInternal, HasSubstr("without a result (code 0)")));
  options_.program = "/nowhere/rigcal-worker";
  EXPECT_THAT(Solve(server::SolveInWorker(options_)).result,
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("/nowhere/rigcal-worker")));
}

TEST_F(SolveInWorker, AFolderThatCannotBeWrittenIsNamed) {
  Record("cameras=2;duration=1");
  options_.scratch_dir = "/nowhere";
  EXPECT_THAT(Solve(server::SolveInWorker(options_)).result,
              StatusIs(absl::StatusCode::kUnavailable,
                       AllOf(HasSubstr("/nowhere"), HasSubstr("cannot be read"))));
}

}  // namespace
}  // namespace rigcal::server::solve_in_worker_test
