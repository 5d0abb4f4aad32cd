// SPDX-License-Identifier: Apache-2.0
// rigcal-server check, backup, restore and compact, on a server that runs and on one that does not.
#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/simulation/world/simulated_world.h"
#include "common/wire/camera_wire.h"
#include "common/wire/grpc_status.h"
#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::care_commands_test {
namespace {

namespace fs = std::filesystem;

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr uint32_t kBatchRows = 4;
constexpr int kCameras = 4;

class CareCommands : public ::testing::Test {
 protected:
  CareCommands() {
    SimulationOptions options;
    options.camera_count = kCameras;
    options.duration_s = 40;
    options.rate_hz = 10;
    Target target;
    target.marker_positions_m = {0, 0.13, 0.39};
    world_ = std::make_unique<SimulatedWorld>(*SimulatedWorld::Create(options, target));
    Start();
  }

  void Start() { server_ = std::make_unique<ServerProcess>(data_); }
  void Stop() {
    server_->process().Signal(SIGTERM);
    EXPECT_EQ(server_->process().Wait(), 0) << server_->process().StandardError();
    server_.reset();
  }
  CommandResult Care(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "rigcal-server");
    arguments.insert(arguments.end(), {"--data-dir", data_.string()});
    return RunCommand(arguments);
  }
  fs::path Database() const { return data_ / "rigcal.db"; }

  // A finished session of this id; returns the number of its rows.
  uint32_t Deliver(const std::string& id) {
    ServerClient client(server_->address());
    v1::CreateSessionRequest request;
    request.set_id(id);
    *request.mutable_target() = wire::ToProto(world_->target());
    for (const SimulatedCamera& camera : world_->cameras()) {
      *request.add_cameras() = wire::ToProto(camera.description);
    }
    EXPECT_THAT(client.CreateSession(request), IsOk());
    EXPECT_THAT(client.StartSession(id), IsOk());
    uint32_t rows = 0;
    for (int c = 0; c < kCameras; ++c) {
      ObservationBatch batch;
      batch.stream = {id, world_->cameras()[static_cast<size_t>(c)].description.camera, 1};
      batch.marker_count = 3;
      const int frames = world_->FrameCount(c);
      for (int frame = 0; frame < frames; ++frame, ++rows) {
        batch.Append(world_->Observe(c, frame));
        if (batch.rows() < kBatchRows && frame + 1 < frames) continue;
        EXPECT_THAT(client.Upload(batch), IsOk());
        const uint32_t next = batch.end_seq();
        batch = batch.Slice(0, 0);
        batch.first_seq = next;
      }
      EXPECT_THAT(client.UploadEnd(id, batch.stream.camera, 1, static_cast<uint32_t>(frames)),
                  IsOk());
    }
    EXPECT_THAT(client.WaitUntilFinished(id), IsOk());
    return rows;
  }

  // Flips a bit in every place of the file that has this text; returns how many there are.
  int FlipBitsOf(const std::string& text) {
    std::string bytes;
    {
      std::ifstream file(Database(), std::ios::binary);
      bytes.assign(std::istreambuf_iterator<char>(file), {});
    }
    std::fstream file(Database(), std::ios::binary | std::ios::in | std::ios::out);
    int places = 0;
    for (size_t at = bytes.find(text); at != std::string::npos; at = bytes.find(text, at + 1)) {
      file.seekp(static_cast<std::streamoff>(at));
      file.put(static_cast<char>(bytes[at] ^ 1));
      ++places;
    }
    return places;
  }

  // Flips a bit in so many of the stored batches, with the server stopped; returns how many batches
  // there are.
  size_t FlipBits(size_t count) {
    SQLite::Database database(Database().string(), SQLite::OPEN_READWRITE);
    std::vector<std::pair<int64_t, std::string>> batches;
    SQLite::Statement row(database, "SELECT id, body FROM batch");
    while (row.executeStep()) {
      batches.emplace_back(row.getColumn(0).getInt64(), row.getColumn(1).getString());
    }
    std::mt19937 random(5);
    std::shuffle(batches.begin(), batches.end(), random);
    SQLite::Transaction transaction(database);
    for (size_t i = 0; i < std::min(count, batches.size()); ++i) {
      auto& [id, body] = batches[i];
      char& byte = body[random() % body.size()];
      byte = static_cast<char>(byte ^ (1 << (random() % 8)));
      SQLite::Statement write(database, "UPDATE batch SET body=? WHERE id=?");
      write.bind(1, body.data(), static_cast<int>(body.size()));
      write.bind(2, id);
      write.exec();
    }
    transaction.commit();
    return batches.size();
  }

  const TemporaryDirectory directory_;
  const fs::path data_ = directory_.path() / "store";
  std::unique_ptr<SimulatedWorld> world_;
  std::unique_ptr<ServerProcess> server_;
};

TEST_F(CareCommands, AHundredDamagedBatchesLoseTheirRowsOnlyAndTheRestIsCalibrated) {
  const uint32_t rows = Deliver("wave");
  Stop();
  ASSERT_EQ(FlipBits(100), rows / kBatchRows);
  Start();
  ServerClient client(server_->address());
  const auto batches = client.ReadObservations("wave");
  ASSERT_THAT(batches, IsOk());
  uint32_t read = 0;
  for (const ObservationBatch& batch : *batches) read += static_cast<uint32_t>(batch.rows());
  EXPECT_EQ(read, rows - 100 * kBatchRows);
  const auto session = client.GetSession("wave");
  ASSERT_THAT(session, IsOk());
  uint64_t damaged = 0;
  for (const v1::SessionCamera& camera : session->cameras()) damaged += camera.damaged_count();
  EXPECT_EQ(damaged, 100 * kBatchRows);
  const auto calibration = client.Calibrate("wave");
  ASSERT_THAT(calibration, IsOk());
  ASSERT_EQ(calibration->state(), v1::Calibration::STATE_SUCCEEDED) << calibration->error();
  uint64_t counted = 0;
  for (const v1::RefusalCount& refusal : calibration->refused()) {
    if (refusal.reason() == v1::REFUSAL_REASON_DAMAGED_RECORD) counted += refusal.count();
  }
  EXPECT_EQ(counted, 100 * kBatchRows);
  const CommandResult shown =
      RunCommand({"rigcal", "session", "get", "wave"}, {{"RIGCAL_SERVER", server_->address()}});
  EXPECT_THAT(shown.output, AllOf(HasSubstr("damaged_record"), HasSubstr("checksum is wrong")));
  // While the server runs.
  const CommandResult check = Care({"check"});
  EXPECT_EQ(check.exit_code, 1);
  EXPECT_THAT(check.output, AllOf(HasSubstr("session wave, camera"), HasSubstr("100 faults"),
                                  HasSubstr("400 observations lost")));
}

TEST_F(CareCommands, ADamagedSessionIsNamedAndTheOthersWorkOn) {
  Deliver("wave");
  v1::CreateSessionRequest request;
  request.set_id("hurt");
  request.set_title("a title to be found");
  *request.mutable_target() = wire::ToProto(world_->target());
  ASSERT_THAT(ServerClient(server_->address()).CreateSession(request), IsOk());
  Stop();
  EXPECT_EQ(FlipBitsOf("a title to be found"), 2) << "in the record and in its summary";
  Start();
  const auto rigcal = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "rigcal");
    return RunCommand(arguments, {{"RIGCAL_SERVER", server_->address()}});
  };
  EXPECT_THAT(rigcal({"session", "list"}).output,
              AllOf(HasSubstr("wave"), HasSubstr("the record of session hurt is damaged")));
  EXPECT_THAT(rigcal({"session", "get", "hurt"}).error, HasSubstr("session hurt is damaged"));
  EXPECT_THAT(rigcal({"doctor"}).output, HasSubstr("session hurt is damaged"));
  ServerClient client(server_->address());
  const auto calibration = client.Calibrate("wave");
  ASSERT_THAT(calibration, IsOk());
  EXPECT_EQ(calibration->state(), v1::Calibration::STATE_SUCCEEDED) << calibration->error();
  EXPECT_EQ(Care({"check"}).exit_code, 1);
  EXPECT_EQ(rigcal({"session", "delete", "hurt", "--yes"}).exit_code, 0);
  EXPECT_EQ(Care({"check"}).exit_code, 0);
}

TEST_F(CareCommands, BackupOfARunningServerIsRestored) {
  const uint32_t rows = Deliver("first");
  CommandResult check = Care({"check"});
  EXPECT_EQ(check.exit_code, 0) << check.error;
  EXPECT_THAT(check.output, AllOf(HasSubstr("no faults"), HasSubstr(absl::StrCat(rows))));
  const std::string file = (directory_.path() / "today.rigcal").string();
  const CommandResult backup = Care({"backup", file});
  EXPECT_EQ(backup.exit_code, 0) << backup.error;
  EXPECT_THAT(backup.output, HasSubstr(file));
  EXPECT_EQ(Care({"backup", file}).exit_code, 1);
  Deliver("second");

  CommandResult restore = Care({"restore", file});
  EXPECT_EQ(restore.exit_code, 1);
  EXPECT_THAT(restore.error, AllOf(HasSubstr("in use by another server"),
                                   HasSubstr(std::to_string(server_->process().pid()))));
  Stop();
  restore = Care({"restore", file});
  EXPECT_EQ(restore.exit_code, 0) << restore.error;
  EXPECT_THAT(restore.output, HasSubstr("before-restore"));
  Start();
  ServerClient client(server_->address());
  EXPECT_THAT(client.GetSession("first"), IsOk());
  EXPECT_FALSE(client.GetSession("second").ok());
  check = Care({"check"});
  EXPECT_EQ(check.exit_code, 0) << check.output;
}

TEST_F(CareCommands, CompactShrinksTheDatabaseOfARunningServerAndOfNone) {
  Deliver("a");
  for (const bool running : {true, false}) {
    if (!server_) Start();
    for (int i = 0; i < 3; ++i) Deliver(absl::StrCat("b", running, i));
    for (int i = 0; i < 3; ++i) {
      const CommandResult deleted =
          RunCommand({"rigcal", "session", "delete", absl::StrCat("b", running, i), "--yes"},
                     {{"RIGCAL_SERVER", server_->address()}});
      ASSERT_EQ(deleted.exit_code, 0) << deleted.error;
    }
    Stop();
    const uintmax_t before = fs::file_size(Database());
    if (running) Start();
    const CommandResult compact = Care({"compact"});
    EXPECT_EQ(compact.exit_code, 0) << compact.error;
    EXPECT_THAT(compact.output, HasSubstr("now"));
    if (running) Stop();
    EXPECT_LT(fs::file_size(Database()), before / 2);
    const CommandResult check = Care({"check"});
    EXPECT_EQ(check.exit_code, 0) << check.output;
  }
}

TEST_F(CareCommands, BadUse) {
  Stop();
  const CommandResult check = RunCommand(
      {"rigcal-server", "check", "--data-dir", (directory_.path() / "nothing").string()});
  EXPECT_EQ(check.exit_code, 1);
  EXPECT_THAT(check.error, HasSubstr("there is no database"));
  EXPECT_EQ(Care({"backup"}).exit_code, 2);
  EXPECT_EQ(Care({"repair"}).exit_code, 2);
  EXPECT_EQ(Care({"restore", (directory_.path() / "none").string()}).exit_code, 1);
}

}  // namespace
}  // namespace rigcal::testing::care_commands_test
