// SPDX-License-Identifier: Apache-2.0
// Twelve simulated cameras, and faults at random instants: server and agents killed or stopped, the
// link cut or down. Afterwards every observation is accounted for, and memory and descriptors have
// not grown. RIGCAL_SOAK_MINUTES=30 makes it long, with a fault about every minute.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/wire/grpc_status.h"
#include "rigcal/v1/session_service.grpc.pb.h"
#include "tests/testing/process.h"
#include "tests/testing/process_figures.h"
#include "tests/testing/server_client.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/tcp_fault_proxy.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::soak_test {
namespace {

using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

constexpr int kAgents = 4;
constexpr int kCamerasPerAgent = 3;
constexpr int kCameras = kAgents * kCamerasPerAgent;

// How long faults happen, the same again without kills of what is measured.
Seconds Duration() {
  const char* minutes = std::getenv("RIGCAL_SOAK_MINUTES");
  return Seconds(minutes == nullptr ? 150 : std::max(1.0, 60 * std::atof(minutes)));
}

// Memory and descriptors of one process over a while.
class Figures {
 public:
  void Sample(double at_s, pid_t pid) {
    const double memory_mb = MemoryMb(pid);
    if (memory_mb == 0) return;
    at_s_.push_back(at_s);
    memory_mb_.push_back(memory_mb);
    descriptors_.push_back(OpenDescriptors(pid));
  }
  size_t size() const { return at_s_.size(); }
  // By least squares.
  double SlopeMbPerHour() const {
    const double n = static_cast<double>(size());
    double t = 0, m = 0, tt = 0, tm = 0;
    for (size_t i = 0; i < size(); ++i) {
      t += at_s_[i], m += memory_mb_[i];
      tt += at_s_[i] * at_s_[i], tm += at_s_[i] * memory_mb_[i];
    }
    const double variance = n * tt - t * t;
    return variance > 0 ? 3600 * (n * tm - t * m) / variance : 0;
  }
  double PeakMb() const { return *std::max_element(memory_mb_.begin(), memory_mb_.end()); }
  // Of a part of the time, where they were fewest: faults open some for a while.
  int Descriptors(double from, double to) const {
    const auto at = [&](double part) {
      return descriptors_.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(size()));
    };
    return *std::min_element(at(from), at(to));
  }

 private:
  std::vector<double> at_s_;
  std::vector<double> memory_mb_;
  std::vector<int> descriptors_;
};

class Soak : public ::testing::Test {
 protected:
  void SetUp() override {
    server_ = std::make_unique<ServerProcess>(directory_.path() / "store");
    port_ = server_->port();
    proxy_ = std::make_unique<TcpFaultProxy>(port_);
    agents_.resize(kAgents);
    for (int i = 0; i < kAgents; ++i) StartAgent(i);
    AwaitAgents();
    v1::CreateSessionRequest request;
    request.set_id("wave");
    request.mutable_target()->set_kind(v1::Target::KIND_WAND);
    for (const double position : {0.0, 0.13, 0.39}) {
      request.mutable_target()->add_marker_positions_m(position);
    }
    ASSERT_THAT(client().CreateSession(request), IsOk());
    ASSERT_THAT(client().StartSession("wave"), IsOk());
  }

  // At the server itself: the link is only the agents'.
  ServerClient client() const { return ServerClient(server_->address()); }

  void StartAgent(int index) {
    std::string config = "[spool]\nlimit_mb = 256\n";
    for (int camera = kCamerasPerAgent * index; camera < kCamerasPerAgent * (index + 1); ++camera) {
      absl::StrAppend(&config, "[[camera]]\nsource = \"sim:camera=", camera, ";cameras=", kCameras,
                      ";duration=80000;rate=50;speed=1\"\n");
    }
    const std::string name = "agent" + std::to_string(index);
    const auto file = directory_.WriteFile(name + ".toml", config);
    agents_[static_cast<size_t>(index)] = std::make_unique<Process>(
        Process::Options{{"rigcal-agent", "--config", file.string(), "--server",
                          "127.0.0.1:" + std::to_string(proxy_->port()), "--state-dir",
                          (directory_.path() / name).string()},
                         {}});
  }
  void AwaitAgents() {
    const auto connected = [&] {
      const auto listed = client().ListAgents();
      return listed.ok() && std::count_if(listed->begin(), listed->end(), [](const v1::Agent& a) {
                              return a.connected();
                            }) == kAgents;
    };
    ASSERT_TRUE(WaitFor(connected, std::chrono::seconds(90))) << agents_[0]->StandardError();
  }

  void KillServer() {
    server_->process().Signal(SIGKILL);
    server_->process().Wait();
    server_.reset();
    server_ = std::make_unique<ServerProcess>(directory_.path() / "store", port_);
  }
  void KillAgent(int index) {
    Process& agent = *agents_[static_cast<size_t>(index)];
    agent.Signal(SIGKILL);
    agent.Wait();
    StartAgent(index);
  }
  void Stop(const Process& process, milliseconds how_long) const {
    process.Signal(SIGSTOP);
    std::this_thread::sleep_for(how_long);
    process.Signal(SIGCONT);
  }

  // One fault. Where memory is measured, the server and the first agent are not killed.
  void Fault(bool may_kill_all, milliseconds pause) {
    const int agent = static_cast<int>(random_() % kAgents);
    const int kind = static_cast<int>(random_() % (may_kill_all ? 6 : 5));
    switch (kind) {
      case 0:
        ++faults_["link cut"];
        proxy_->Cut();
        return proxy_->Restore();
      case 1:
        ++faults_["link down"];
        proxy_->Set({.is_black_hole = true});
        std::this_thread::sleep_for(pause);
        return proxy_->Restore();
      case 2:
        ++faults_["agent stopped"];
        return Stop(*agents_[static_cast<size_t>(agent)], pause);
      case 3:
        ++faults_["server stopped"];
        return Stop(server_->process(), pause);
      case 4:
        ++faults_["agent killed"];
        return KillAgent(may_kill_all ? agent : 1 + agent % (kAgents - 1));
      default:
        ++faults_["server killed"];
        return KillServer();
    }
  }

  // Every stream has each of its numbers once: as the server streams them, and as it says.
  void ExpectEveryNumberOnce(const v1::Session& session) {
    std::map<std::pair<std::string, uint32_t>, uint32_t> next;
    const auto stub = v1::SessionService::NewStub(
        grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials()));
    grpc::ClientContext context;
    v1::ReadObservationsRequest request;
    request.set_session_id("wave");
    const auto reader = stub->ReadObservations(&context, request);
    v1::ReadObservationsResponse response;
    while (reader->Read(&response)) {
      const v1::ObservationBatch& batch = response.batch();
      uint32_t& seq = next[{batch.camera(), batch.stream_epoch()}];
      EXPECT_EQ(batch.first_seq(), seq + 1) << batch.camera();
      seq = batch.first_seq() + static_cast<uint32_t>(batch.time_ns_size()) - 1;
    }
    ASSERT_THAT(wire::FromGrpc(reader->Finish()), IsOk());
    EXPECT_EQ(session.cameras_size(), kCameras);
    for (const v1::SessionCamera& camera : session.cameras()) {
      const std::string& name = camera.description().camera();
      EXPECT_TRUE(camera.ended()) << name;
      EXPECT_EQ(camera.conflict_count(), 0u) << name;
      for (const v1::StreamStatus& stream : camera.streams()) {
        EXPECT_TRUE(stream.ended()) << name;
        EXPECT_EQ((next[{name, stream.stream_epoch()}]), stream.last_seq()) << name;
      }
    }
  }

  void Print(const char* name, const Figures& figures) {
    std::printf("%s: peak %.1f MB, slope %+.1f MB/h, descriptors %d, then %d (%zu samples)\n", name,
                figures.PeakMb(), figures.SlopeMbPerHour(), figures.Descriptors(0, 0.5),
                figures.Descriptors(0.5, 1), figures.size());
  }

  const TemporaryDirectory directory_;
  int port_ = 0;
  std::unique_ptr<ServerProcess> server_;
  std::unique_ptr<TcpFaultProxy> proxy_;
  std::vector<std::unique_ptr<Process>> agents_;
  std::mt19937 random_{16};
  std::map<std::string, int> faults_;
};

TEST_F(Soak, LosesNothingAndDoesNotGrow) {
  const bool is_long = Duration() >= std::chrono::minutes(10);
  // A fault a minute, or as many as fit.
  const int mean_ms = is_long ? 60'000 : 1'500;
  const auto start = Clock::now();
  const auto elapsed = [&] { return Seconds(Clock::now() - start); };
  Figures server, agent;
  auto next_fault = start + milliseconds(mean_ms / 2);
  while (elapsed() < Duration()) {
    const bool measuring = elapsed() > Duration() / 3;
    if (Clock::now() >= next_fault) {
      Fault(!measuring, milliseconds(mean_ms / 6 + random_() % static_cast<unsigned>(mean_ms / 6)));
      next_fault =
          Clock::now() + milliseconds(mean_ms / 2 + random_() % static_cast<unsigned>(mean_ms));
    }
    // After some time to warm up since the last kill.
    if (elapsed() > Duration() / 2) {
      server.Sample(elapsed().count(), server_->process().pid());
      agent.Sample(elapsed().count(), agents_[0]->pid());
    }
    std::this_thread::sleep_for(milliseconds(is_long ? 1000 : 100));
  }

  AwaitAgents();
  ASSERT_THAT(client().StopSession("wave", 90), IsOk());
  const auto finished = client().WaitUntilFinished("wave");
  ASSERT_THAT(finished, IsOk());
  EXPECT_EQ(finished->missing_cameras_size(), 0) << agents_[0]->StandardError();
  EXPECT_EQ(finished->late_count(), 0u);
  ExpectEveryNumberOnce(*finished);
  const CommandResult verified =
      RunCommand({"rigcal", "session", "verify", "wave", "--server", server_->address()});
  EXPECT_EQ(verified.exit_code, 0) << verified.output << verified.error;

  for (const auto& [name, count] : faults_) std::printf("%d times: %s\n", count, name.c_str());
  std::printf("%llu observations of %d cameras\n",
              static_cast<unsigned long long>(finished->observation_count()), kCameras);
  Print("server", server);
  Print("agent", agent);
  for (const Figures* figures : {&server, &agent}) {
    ASSERT_GT(figures->size(), 20u);
    EXPECT_LE(figures->Descriptors(0.5, 1), figures->Descriptors(0, 0.5) + 8);
    if (kMemoryIsSanitized) continue;
    EXPECT_LT(figures->PeakMb(), 300);
    if (is_long) {
      EXPECT_LT(figures->SlopeMbPerHour(), 30);
    }
  }
}

}  // namespace
}  // namespace rigcal::testing::soak_test
