// SPDX-License-Identifier: Apache-2.0
// `rigcal session verify` says "verified" only where everything that was detected can be read from
// the server or was dropped and counted; else which rows are where, and what to do. A calibration
// of such a session says so, too.
#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/wire/camera_wire.h"
#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::session_verify_test {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int kCameras = 3;
constexpr uint64_t kRows = 30 * 50;  // of a camera, where a session is recorded to its end

// Each camera's agent is a process of its own where a test says so.
class SessionVerify : public ::testing::Test {
 protected:
  void StartServer(const std::string& failpoint = "") {
    std::map<std::string, std::string> environment;
    if (!failpoint.empty()) environment["RIGCAL_FAILPOINT"] = failpoint;
    server_ = std::make_unique<ServerProcess>(directory_.path() / "store", port_, environment);
    port_ = server_->port();
  }
  void StopServer() {
    server_->process().Signal(SIGTERM);
    EXPECT_EQ(server_->process().Wait(), 0) << server_->process().StandardError();
    server_.reset();
  }
  // `source`: of camera 0, without its number.
  std::unique_ptr<Process> StartAgent(const std::string& name, const std::vector<int>& cameras,
                                      const std::string& source) const {
    std::vector<std::string> arguments = {"rigcal-agent",
                                          "--server",
                                          server_->address(),
                                          "--agent-id",
                                          name,
                                          "--state-dir",
                                          (directory_.path() / name).string()};
    for (const int camera : cameras) {
      arguments.push_back("--source");
      arguments.push_back("sim:camera=" + std::to_string(camera) +
                          ";cameras=" + std::to_string(kCameras) + ";" + source);
    }
    return std::make_unique<Process>(Process::Options{arguments, {}});
  }
  ServerClient client() const { return ServerClient(server_->address()); }
  void StartSession(size_t agents) {
    ASSERT_TRUE(WaitFor([&] {
      const auto listed = client().ListAgents();
      return listed.ok() && listed->size() == agents &&
             std::ranges::all_of(*listed, [](const v1::Agent& one) { return one.connected(); });
    }));
    Target target;
    target.marker_positions_m = {0, 0.13, 0.39};
    v1::CreateSessionRequest request;
    request.set_id("wave");
    *request.mutable_target() = wire::ToProto(target);
    ASSERT_THAT(client().CreateSession(request), IsOk());
    ASSERT_THAT(client().StartSession("wave"), IsOk());
  }
  uint64_t StoredCount(const std::string& camera) const {
    const auto session = client().GetSession("wave");
    if (!session.ok()) return 0;
    for (const v1::SessionCamera& one : session->cameras()) {
      if (one.description().camera() == camera) return one.observation_count();
    }
    return 0;
  }
  CommandResult Rigcal(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "rigcal");
    arguments.insert(arguments.end(), {"--server", server_->address()});
    return RunCommand(arguments);
  }
  json Verify(int expected_exit_code) const {
    const CommandResult result = Rigcal({"session", "verify", "wave", "-o", "json"});
    EXPECT_EQ(result.exit_code, expected_exit_code) << result.output << result.error;
    const json verified = json::parse(result.output, nullptr, false);
    EXPECT_EQ(verified.at("holds"), expected_exit_code == 0);
    EXPECT_EQ(verified.at("problems").empty(), expected_exit_code == 0);
    uint64_t dropped = 0;
    for (const auto& [reason, count] : verified.at("sum").at("dropped").items()) {
      dropped += count.get<uint64_t>();
    }
    const json& sum = verified.at("sum");
    EXPECT_EQ(sum.at("detected").get<uint64_t>(),
              sum.at("durable").get<uint64_t>() + sum.at("damaged").get<uint64_t>() +
                  sum.at("spooled").get<uint64_t>() + sum.at("missing").get<uint64_t>() + dropped);
    return verified;
  }
  static std::vector<std::string> KindsOf(const json& verified) {
    std::vector<std::string> kinds;
    for (const json& problem : verified.at("problems")) kinds.push_back(problem.at("kind"));
    return kinds;
  }
  // Flips a bit of every `step`-th batch of the camera, with the server stopped; the same call
  // again heals them. Returns how many rows they have.
  uint64_t FlipBatches(const std::string& camera, int step) const {
    SQLite::Database database((directory_.path() / "store/rigcal.db").string(),
                              SQLite::OPEN_READWRITE);
    std::vector<std::pair<int64_t, std::string>> batches;
    uint64_t rows = 0;
    {
      SQLite::Statement query(database,
                              "SELECT b.id, b.row_count, b.body FROM batch b JOIN stream s ON "
                              "s.id = b.id >> 32 JOIN session_camera c ON c.id = s.camera_id "
                              "WHERE c.camera = ? ORDER BY b.id");
      query.bind(1, camera);
      for (int i = 0; query.executeStep(); ++i) {
        if (i % step != 0) continue;
        batches.emplace_back(query.getColumn(0).getInt64(), query.getColumn(2).getString());
        rows += query.getColumn(1).getUInt();
      }
    }
    for (auto& [id, body] : batches) {
      body[body.size() / 2] = static_cast<char>(body[body.size() / 2] ^ 4);
      SQLite::Statement write(database, "UPDATE batch SET body=? WHERE id=?");
      write.bind(1, body.data(), static_cast<int>(body.size()));
      write.bind(2, id);
      EXPECT_EQ(write.exec(), 1);
    }
    database.exec("DELETE FROM damaged_batch");
    return rows;
  }
  // The finding about a camera; null: none.
  json Calibrate(int expected_exit_code) const {
    const CommandResult result = Rigcal({"calibrate", "wave", "--wait", "-o", "json"});
    EXPECT_EQ(result.exit_code, expected_exit_code) << result.output << result.error;
    return json::parse(result.output, nullptr, false);
  }
  static json FindingOf(const json& calibration, const std::string& camera) {
    if (!calibration.contains("findings")) return {};
    for (const json& finding : calibration.at("findings")) {
      if (finding.at("kind") == "FINDING_KIND_INCOMPLETE_SESSION" &&
          finding.at("camera") == camera) {
        return finding;
      }
    }
    return {};
  }

  TemporaryDirectory directory_;
  int port_ = 0;
  std::unique_ptr<ServerProcess> server_;
};

TEST_F(SessionVerify, RowsOfDamagedBatchesAreNamed) {
  StartServer();
  auto agent = StartAgent("pc", {0, 1, 2}, "duration=30;rate=50;speed=20");
  ASSERT_NO_FATAL_FAILURE(StartSession(1));
  ASSERT_THAT(client().WaitUntilFinished("wave"), IsOk());
  const json whole = Verify(0);
  const uint64_t detected = whole.at("sum").at("detected");
  EXPECT_EQ(detected, 3u * kRows);
  EXPECT_TRUE(FindingOf(Calibrate(0), "sim_1").is_null());
  agent->Signal(SIGTERM);
  EXPECT_EQ(agent->Wait(), 0);

  StopServer();
  uint64_t damaged = FlipBatches("sim_1", 6);
  StartServer();
  json verified = Verify(5);
  EXPECT_THAT(KindsOf(verified), ::testing::ElementsAre("damaged"));
  const json& problem = verified.at("problems")[0];
  EXPECT_EQ(problem.at("camera"), "sim_1");
  EXPECT_EQ(problem.at("count"), damaged);
  EXPECT_EQ(verified.at("sum").at("damaged"), damaged);
  EXPECT_EQ(verified.at("sum").at("durable"), detected - damaged);
  EXPECT_EQ(problem.at("rows")[0].at("first"), 1);
  EXPECT_THAT(problem.at("what_to_do").get<std::string>(), HasSubstr("restore"));
  const CommandResult table = Rigcal({"session", "verify", "wave"});
  EXPECT_EQ(table.exit_code, 5);
  EXPECT_THAT(table.output, AllOf(HasSubstr("\nnot verified: camera sim_1"),
                                  ::testing::Not(HasSubstr("\nverified"))));
  json calibration = Calibrate(0);
  json finding = FindingOf(calibration, "sim_1");
  ASSERT_FALSE(finding.is_null()) << calibration;
  EXPECT_NEAR(finding.at("value").get<double>(), 100 * static_cast<double>(damaged) / kRows, 1e-6);
  EXPECT_EQ(finding.at("severity"), "FINDING_SEVERITY_WARNING");
  EXPECT_NE(calibration.at("quality").at("grade"), "GRADE_GOOD");
  EXPECT_THAT(calibration.at("quality").at("reasons").get<std::vector<std::string>>(),
              Contains(HasSubstr("camera sim_1")));

  // Half of the camera: no grade for that.
  StopServer();
  FlipBatches("sim_1", 6);
  damaged = FlipBatches("sim_1", 2);
  ASSERT_GT(damaged, 4 * kRows / 10);
  StartServer();
  EXPECT_EQ(Verify(5).at("sum").at("damaged"), damaged);
  calibration = Calibrate(3);
  EXPECT_EQ(calibration.at("quality").at("grade"), "GRADE_BAD");
  EXPECT_EQ(FindingOf(calibration, "sim_1").at("severity"), "FINDING_SEVERITY_ERROR");

  StopServer();
  FlipBatches("sim_1", 2);
  StartServer();
  EXPECT_EQ(Verify(0).at("sum").at("durable"), detected);
}

TEST_F(SessionVerify, AnAgentThatWasKilledIsNamedUntilItIsBack) {
  StartServer();
  constexpr char kSource[] = "duration=60;rate=50;speed=6";
  auto stays = StartAgent("pc-a", {0, 1}, kSource);
  auto killed = StartAgent("pc-b", {2}, kSource);
  ASSERT_NO_FATAL_FAILURE(StartSession(2));
  ASSERT_TRUE(WaitFor([&] { return StoredCount("sim_2") >= 150; })) << killed->StandardError();
  killed->Signal(SIGKILL);
  killed->Wait();
  ASSERT_TRUE(WaitFor([&] { return StoredCount("sim_0") >= 900; })) << stays->StandardError();
  ASSERT_THAT(client().StopSession("wave", 1), IsOk());
  const auto finished = client().WaitUntilFinished("wave");
  ASSERT_THAT(finished, IsOk());
  EXPECT_THAT(finished->missing_cameras(), ::testing::ElementsAre("sim_2"));

  const uint64_t durable = StoredCount("sim_2");
  for (const bool restarted : {false, true}) {
    if (restarted) {
      StopServer();
      StartServer();
    }
    const json verified = Verify(5);
    ASSERT_THAT(KindsOf(verified), ::testing::ElementsAre("away")) << verified;
    const json& problem = verified.at("problems")[0];
    EXPECT_EQ(problem.at("camera"), "sim_2");
    EXPECT_EQ(problem.at("rows")[0].at("first"), durable + 1);
    EXPECT_TRUE(problem.at("rows").back().at("last").is_null());
    EXPECT_THAT(problem.at("where").get<std::string>(), HasSubstr("agent pc-b"));
    EXPECT_THAT(problem.at("what_to_do").get<std::string>(), HasSubstr("start agent pc-b again"));
  }
  // Most of what the others saw is missing of this camera.
  const json calibration = Calibrate(3);
  const json finding = FindingOf(calibration, "sim_2");
  ASSERT_FALSE(finding.is_null()) << calibration;
  EXPECT_GT(finding.at("value").get<double>(), 40);
  EXPECT_EQ(calibration.at("quality").at("grade"), "GRADE_BAD");
  EXPECT_TRUE(FindingOf(calibration, "sim_0").is_null());

  killed = StartAgent("pc-b", {2}, kSource);
  ASSERT_TRUE(WaitFor([&] {
    const auto session = client().GetSession("wave");
    return session.ok() && std::ranges::all_of(session->cameras(),
                                               [](const auto& camera) { return camera.ended(); });
  })) << killed->StandardError();
  EXPECT_THAT(Verify(0).at("problems"), IsEmpty());
}

// Server and agent are killed while they work, and the spool loses its last file: the agent counts
// what is gone, and where it cannot, nobody says "verified".
TEST_F(SessionVerify, ASpoolThatLostItsEndIsCountedOrNotVerified) {
  for (const bool has_proof : {true, false}) {
    SCOPED_TRACE(has_proof);
    server_.reset();
    std::filesystem::remove_all(directory_.path() / "store");
    std::filesystem::remove_all(directory_.path() / "pc");
    StartServer();
    constexpr char kSource[] = "duration=60;rate=100;speed=2";
    auto agent = StartAgent("pc", {0, 1, 2}, kSource);
    ASSERT_NO_FATAL_FAILURE(StartSession(1));
    ASSERT_TRUE(WaitFor([&] { return StoredCount("sim_2") >= 50; })) << agent->StandardError();
    server_->process().Signal(SIGKILL);
    server_->process().Wait();
    const auto spool = directory_.path() / "pc" / "spool";
    const auto bytes = [&] {
      uintmax_t sum = 0;
      for (const auto& entry : std::filesystem::directory_iterator(spool)) {
        if (entry.path().extension() == ".seg") sum += entry.file_size();
      }
      return sum;
    };
    const uintmax_t before = bytes();
    ASSERT_TRUE(WaitFor([&] { return bytes() > before + 20'000; })) << agent->StandardError();
    agent->Signal(SIGKILL);
    agent->Wait();
    std::vector<std::filesystem::path> segments;
    for (const auto& entry : std::filesystem::directory_iterator(spool)) {
      if (entry.path().extension() == ".seg") segments.push_back(entry.path());
    }
    ASSERT_EQ(segments.size(), 3u);
    std::filesystem::remove(segments[0]);
    if (!has_proof) std::filesystem::remove(spool / "ends");
    server_.reset();
    StartServer();
    agent = StartAgent("pc", {0, 1, 2}, kSource);
    ASSERT_TRUE(WaitFor([&] {
      const auto listed = client().ListAgents();
      return listed.ok() && listed->size() == 1 && listed->at(0).connected();
    }));
    const CommandResult stopped = Rigcal({"session", "stop", "wave", "--wait"});
    EXPECT_EQ(stopped.exit_code, has_proof ? 0 : 5) << stopped.error;
    const json verified = Verify(has_proof ? 0 : 5);
    if (has_proof) {
      EXPECT_GT(verified.at("sum").at("dropped").at("spool_damaged"), 50) << verified;
      continue;
    }
    EXPECT_THAT(KindsOf(verified), AllOf(Contains("end_unknown"), Each("end_unknown")));
    EXPECT_THAT(stopped.error, HasSubstr("is not known: agent pc"));
  }
}

TEST_F(SessionVerify, RowsThatWaitInASpoolAreNotDurable) {
  StartServer("before_commit:sleep_1500");
  const auto agent = StartAgent("pc", {0, 1, 2}, "duration=60;rate=100;speed=4");
  ASSERT_NO_FATAL_FAILURE(StartSession(1));
  json verified;
  ASSERT_TRUE(WaitFor([&] {
    verified = Verify(5);
    return verified.at("sum").at("spooled") > 0;
  })) << agent->StandardError();
  EXPECT_THAT(KindsOf(verified), AllOf(Contains("capturing"), Contains("waiting")));
  EXPECT_EQ(verified.at("sum").at("missing"), 0);
  // The last rows and the ends are on their way.
  ASSERT_THAT(client().StopSession("wave", 60), IsOk());
  verified = Verify(5);
  EXPECT_THAT(KindsOf(verified), AllOf(Contains("draining"), Contains("waiting")));
  ASSERT_THAT(client().WaitUntilFinished("wave"), IsOk());
  verified = Verify(0);
  EXPECT_EQ(verified.at("sum").at("detected"), verified.at("sum").at("durable"));
  EXPECT_EQ(verified.at("sum").at("late"), 0);
}

TEST_F(SessionVerify, ASessionThatHasNotStartedAndOneThatIsGone) {
  StartServer();
  const auto agent = StartAgent("pc", {0, 1, 2}, "duration=5;rate=50;speed=20");
  ASSERT_NO_FATAL_FAILURE(StartSession(1));
  ASSERT_THAT(client().WaitUntilFinished("wave"), IsOk());
  EXPECT_EQ(Rigcal({"session", "create", "--target", "wand:0,0.13,0.39", "--id", "next"}).exit_code,
            0);
  EXPECT_EQ(Rigcal({"session", "verify", "next"}).exit_code, 5);
  EXPECT_EQ(Rigcal({"session", "delete", "wave", "--yes"}).exit_code, 0);
  EXPECT_EQ(Rigcal({"session", "verify", "wave"}).exit_code, 1);
}

}  // namespace
}  // namespace rigcal::testing::session_verify_test
