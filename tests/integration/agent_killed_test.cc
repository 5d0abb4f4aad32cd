// SPDX-License-Identifier: Apache-2.0
// An agent is killed in the middle of a session, by a signal and at every failpoint, and starts
// again: everything that was in its spool arrives exactly once (P2, P3, T1).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "agent/spool/disk/disk_spool.h"
#include "common/wire/camera_wire.h"
#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::agent_killed_test {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int kAborted = 128 + SIGABRT;
constexpr int kKilled = 128 + SIGKILL;

class AgentKilled : public ::testing::Test {
 protected:
  void SetUp() override {
    server_ = std::make_unique<ServerProcess>(directory_.path() / "store");
    directory_.WriteFile("agent.toml", R"(
[spool]
limit_mb = 1  # segments of 64 KiB, one in a second
[[camera]]
source = "sim:camera=0;cameras=2;duration=60;rate=100;speed=4"
[[camera]]
source = "sim:camera=1;cameras=2;duration=60;rate=100;speed=4"
)");
  }

  std::unique_ptr<Process> StartAgent(const std::string& failpoint = "",
                                      const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {
        "rigcal-agent",     "--config",    (directory_.path() / "agent.toml").string(), "--server",
        server_->address(), "--state-dir", (directory_.path() / "agent").string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    Process::Options options{arguments, {}};
    if (!failpoint.empty()) options.environment["RIGCAL_FAILPOINT"] = failpoint;
    return std::make_unique<Process>(std::move(options));
  }
  void StartSession(Process& agent) {
    ASSERT_TRUE(WaitFor([&] {
      const auto listed = ServerClient(server_->address()).ListAgents();
      return listed.ok() && listed->size() == 1 && listed->at(0).connected();
    })) << agent.StandardError();
    Target target;
    target.marker_positions_m = {0, 0.13, 0.39};
    v1::CreateSessionRequest request;
    request.set_id("wave");
    *request.mutable_target() = wire::ToProto(target);
    ServerClient client(server_->address());
    ASSERT_THAT(client.CreateSession(request), IsOk());
    ASSERT_THAT(client.StartSession("wave"), IsOk());
  }
  uint64_t StoredCount() const {
    const auto session = ServerClient(server_->address()).GetSession("wave");
    return session.ok() ? session->observation_count() : 0;
  }
  uint64_t SpoolBytes() const {
    uint64_t sum = 0;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(directory_.path() / "agent/spool", error)) {
      if (entry.path().extension() == ".seg") sum += entry.file_size(error);
    }
    return sum;
  }
  // The last number of each stream in the spool, from a copy of it.
  std::map<StreamKey, uint32_t> LastSeqInSpool() const {
    const fs::path copy = directory_.path() / "copy";
    fs::remove_all(copy);
    fs::copy(directory_.path() / "agent/spool", copy);
    agent::DiskSpoolOptions options;
    options.folder = copy.string();
    options.has_thread = false;
    const auto spool = agent::DiskSpool::Create(options);
    EXPECT_THAT(spool, IsOk());
    std::map<StreamKey, uint32_t> last;
    if (!spool.ok()) return last;
    for (const agent::SpooledStream& stream : (*spool)->Streams()) {
      last[stream.stream] = stream.end_seq - 1;
      EXPECT_TRUE(stream.dropped.empty());
    }
    return last;
  }
  nlohmann::json Verify(int expected_exit_code) const {
    const CommandResult result = RunCommand(
        {"rigcal", "session", "verify", "wave", "-o", "json", "--server", server_->address()});
    EXPECT_EQ(result.exit_code, expected_exit_code) << result.output << result.error;
    return nlohmann::json::parse(result.output, nullptr, false);
  }
  // After the agent has ended: starts it again, lets it deliver, and compares.
  void ExpectAllDeliveredAfterARestart() {
    const std::map<StreamKey, uint32_t> spooled = LastSeqInSpool();
    ASSERT_FALSE(spooled.empty());
    const auto agent = StartAgent();
    ServerClient client(server_->address());
    const auto has_ended = [&](const StreamKey& key) {
      const auto session = client.GetSession("wave");
      if (!session.ok()) return false;
      for (const v1::SessionCamera& camera : session->cameras()) {
        if (camera.description().camera() != key.camera) continue;
        EXPECT_FALSE(camera.ended()) << "the new stream has not";
        for (const v1::StreamStatus& stream : camera.streams()) {
          if (stream.stream_epoch() == key.stream_epoch) return stream.ended();
        }
      }
      return false;
    };
    for (const auto& [key, last_seq] : spooled) {
      ASSERT_TRUE(WaitFor([&] { return has_ended(key); })) << agent->StandardError();
    }
    ASSERT_THAT(client.StopSession("wave", 20), IsOk());
    const auto finished = client.WaitUntilFinished("wave");
    ASSERT_THAT(finished, IsOk()) << agent->StandardError();
    EXPECT_EQ(finished->missing_cameras_size(), 0) << agent->StandardError();
    EXPECT_EQ(finished->late_count(), 0u);

    const auto batches = client.ReadObservations("wave");
    ASSERT_THAT(batches, IsOk());
    std::map<StreamKey, std::set<uint32_t>> stored;
    uint64_t rows = 0;
    for (const ObservationBatch& batch : *batches) {
      for (uint32_t seq = batch.first_seq; seq < batch.end_seq(); ++seq, ++rows) {
        stored[batch.stream].insert(seq);
      }
    }
    uint64_t distinct = 0;
    for (const auto& [key, seqs] : stored) distinct += seqs.size();
    EXPECT_EQ(distinct, rows) << "rows are there twice";
    for (const auto& [key, last_seq] : spooled) {
      EXPECT_EQ(stored[key].size(), last_seq) << key.camera;
      if (last_seq > 0) {
        EXPECT_EQ(*stored[key].rbegin(), last_seq) << key.camera;
      }
    }
    EXPECT_EQ(Verify(0).at("holds"), true);
    agent->Signal(SIGTERM);
    EXPECT_EQ(agent->Wait(), 0) << agent->StandardError();
  }

  TemporaryDirectory directory_;
  std::unique_ptr<ServerProcess> server_;
};

TEST_F(AgentKilled, DeliversAfterItsRestartWhatWasInItsSpool) {
  auto agent = StartAgent();
  ASSERT_NO_FATAL_FAILURE(StartSession(*agent));
  ASSERT_TRUE(WaitFor([&] { return StoredCount() >= 200; })) << agent->StandardError();
  // What is detected from now on is in the spool only.
  server_->process().Signal(SIGSTOP);
  const uint64_t before = SpoolBytes();
  ASSERT_TRUE(WaitFor([&] { return SpoolBytes() > before + 50'000; })) << agent->StandardError();
  agent->Signal(SIGKILL);
  EXPECT_EQ(agent->Wait(), kKilled);
  server_->process().Signal(SIGCONT);
  ASSERT_TRUE(WaitFor([&] {
    const auto listed = ServerClient(server_->address()).ListAgents();
    return listed.ok() && !listed->at(0).connected();
  }));
  const auto session = ServerClient(server_->address()).GetSession("wave");
  ASSERT_THAT(session, IsOk());
  for (const v1::SessionCamera& camera : session->cameras()) EXPECT_FALSE(camera.ended());
  // Nobody but the agent knows what it had detected.
  const auto verified = Verify(5);
  EXPECT_EQ(verified.at("holds"), false);
  std::vector<std::string> kinds;
  for (const auto& problem : verified.at("problems")) kinds.push_back(problem.at("kind"));
  EXPECT_THAT(kinds, ElementsAre("capturing", "away", "away"));
  ExpectAllDeliveredAfterARestart();
}

class AgentKilledAtFailpoint : public AgentKilled,
                               public ::testing::WithParamInterface<const char*> {};

TEST_P(AgentKilledAtFailpoint, DeliversAfterItsRestartWhatWasInItsSpool) {
  const auto agent = StartAgent(std::string(GetParam()));
  ASSERT_NO_FATAL_FAILURE(StartSession(*agent));
  ASSERT_EQ(agent->Wait(), kAborted) << agent->StandardError();
  EXPECT_THAT(agent->StandardError(), HasSubstr("failpoint"));
  ExpectAllDeliveredAfterARestart();
}

INSTANTIATE_TEST_SUITE_P(All, AgentKilledAtFailpoint,
                         ::testing::Values("after_spool_append:abort@333", "after_send:abort@40",
                                           "segment_rotation:abort@3",
                                           "checkpoint_rename:abort@3"));

TEST_F(AgentKilled, SaysWhatItLeavesBehindAndDeliversItAtItsNextStart) {
  auto agent = StartAgent();
  ASSERT_NO_FATAL_FAILURE(StartSession(*agent));
  ASSERT_TRUE(WaitFor([&] { return StoredCount() >= 100; })) << agent->StandardError();
  server_->process().Signal(SIGSTOP);
  const uint64_t before = SpoolBytes();
  ASSERT_TRUE(WaitFor([&] { return SpoolBytes() > before + 20'000; })) << agent->StandardError();
  agent->Signal(SIGTERM);
  EXPECT_EQ(agent->Wait(), 3);
  EXPECT_THAT(agent->StandardError(),
              AllOf(HasSubstr(" observations of "), HasSubstr(" are not delivered; they are in "),
                    HasSubstr("agent/spool and are delivered at the next start")));
  server_->process().Signal(SIGCONT);
  const std::map<StreamKey, uint32_t> spooled = LastSeqInSpool();
  ASSERT_EQ(spooled.size(), 2u);
  // It ended its captures: the session is over with what was in the spool.
  agent = StartAgent();
  ServerClient client(server_->address());
  const auto finished = client.WaitUntilFinished("wave");
  ASSERT_THAT(finished, IsOk()) << agent->StandardError();
  uint64_t expected = 0;
  for (const auto& [key, last_seq] : spooled) expected += last_seq;
  EXPECT_EQ(finished->observation_count(), expected);
  EXPECT_EQ(Verify(0).at("holds"), true);
}

TEST_F(AgentKilled, CannotProveASessionWhoseRowsWereInMemory) {
  auto agent = StartAgent("", {"--spool", "memory"});
  ASSERT_NO_FATAL_FAILURE(StartSession(*agent));
  ASSERT_TRUE(WaitFor([&] { return StoredCount() >= 100; })) << agent->StandardError();
  const int port = server_->port();
  server_->process().Signal(SIGKILL);
  server_->process().Wait();
  server_.reset();
  agent->Signal(SIGTERM);
  EXPECT_EQ(agent->Wait(), 3);
  EXPECT_THAT(agent->StandardError(), HasSubstr("they were in memory only and are lost"));
  server_ = std::make_unique<ServerProcess>(directory_.path() / "store", port);
  agent = StartAgent("", {"--spool", "memory"});
  ASSERT_TRUE(WaitFor([&] {
    const auto listed = ServerClient(server_->address()).ListAgents();
    return listed.ok() && !listed->empty() && listed->at(0).connected();
  })) << agent->StandardError();
  const auto verified = Verify(5);
  EXPECT_EQ(verified.at("holds"), false);
  const auto session = ServerClient(server_->address()).GetSession("wave");
  ASSERT_THAT(session, IsOk());
  for (const v1::SessionCamera& camera : session->cameras()) EXPECT_FALSE(camera.ended());
}

}  // namespace
}  // namespace rigcal::testing::agent_killed_test
