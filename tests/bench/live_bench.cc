// SPDX-License-Identifier: Apache-2.0
// The live state while 24 simulated cameras deliver 50 observations/s each, one a message: alone,
// and with a dashboard (live at 4 Hz, every camera's preview once a second, two at a time) and 50
// further clients that poll at 4 Hz. The two take turns, in rounds, so that a slow moment of the
// machine meets both; estimates run in their workers as always. Then the session is over, and the
// same clients poll what does not change.
//
// RIGCAL_LIVE_ROUNDS, RIGCAL_LIVE_SECONDS (of each half of a round) and RIGCAL_LIVE_CAMERAS make it
// shorter.
#include <benchmark/benchmark.h>
#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/simulation/world/simulated_world.h"
#include "common/status/status_macros.h"
#include "common/wire/camera_wire.h"
#include "rigcal/v1/live_service.grpc.pb.h"
#include "tests/bench/bench_agent.h"
#include "tests/bench/suites.h"
#include "tests/testing/http_connection.h"
#include "tests/testing/process.h"
#include "tests/testing/process_figures.h"
#include "tests/testing/server_client.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::bench::live_bench {
namespace {

using std::chrono::milliseconds;
using testing::HttpConnection;
using testing::HttpReply;
using testing::ServerClient;
using testing::ServerProcess;
using SteadyTime = std::chrono::steady_clock::time_point;

constexpr int kPollers = 50;
constexpr milliseconds kPollInterval{250};
constexpr milliseconds kProbeInterval{20};
constexpr milliseconds kPreviewInterval{1000};
constexpr size_t kPreviewBytes = 20'000;
constexpr double kCameraRateHz = 50;

int FromEnvironmentOr(const char* name, int otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::max(1, std::atoi(text));
}

double SecondsOf(std::chrono::steady_clock::duration time) {
  return std::chrono::duration<double>(time).count();
}

double QuantileOf(std::vector<double> values, double q) {
  std::ranges::sort(values);
  return values.empty() ? 0 : values[static_cast<size_t>(q * double(values.size() - 1))];
}

Target BenchWand() {
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  return target;
}

// Sees what becomes visible of a session, and how old the running estimate is.
class Probe {
 public:
  Probe(const std::string& address, std::string session)
      : session_(std::move(session)),
        stub_(v1::LiveService::NewStub(
            grpc::CreateChannel(address, grpc::InsecureChannelCredentials()))),
        thread_([this] { Run(); }) {}
  ~Probe() { Stop(); }

  void Stop() {
    stopping_ = true;
    if (thread_.joinable()) thread_.join();
  }
  // The rest after Stop. Milliseconds from the acknowledgement of each message until it is counted.
  std::vector<double> VisibleMs(const std::string& camera,
                                const std::vector<Acknowledged>& messages) const {
    std::vector<double> visible_ms;
    const auto found = seen_.find(camera);
    if (found == seen_.end()) return visible_ms;
    auto seen = found->second.begin();
    for (const Acknowledged& message : messages) {
      while (seen != found->second.end() && seen->first < message.last_seq) ++seen;
      if (seen == found->second.end()) break;  // the load has ended
      visible_ms.push_back(std::max(0.0, 1e3 * SecondsOf(seen->second - message.time)));
    }
    return visible_ms;
  }
  const std::vector<double>& estimate_ages_s() const { return estimate_ages_s_; }

 private:
  void Run() {
    SteadyTime next = std::chrono::steady_clock::now();
    SteadyTime next_age = next;
    for (; !stopping_; next += kProbeInterval) {
      std::this_thread::sleep_until(next);
      grpc::ClientContext context;
      v1::GetLiveRequest request;
      request.set_since_revision(revision_);
      v1::GetLiveResponse response;
      if (!stub_->GetLive(&context, request, &response).ok()) continue;
      Take(response.live());
      if (is_shown_ && estimate_utc_s_ > 0 && next >= next_age) {
        next_age = next + kPollInterval;
        const auto utc = std::chrono::system_clock::now().time_since_epoch();
        estimate_ages_s_.push_back(std::chrono::duration<double>(utc).count() - estimate_utc_s_);
      }
    }
  }

  void Take(const v1::LiveState& live) {
    const SteadyTime now = std::chrono::steady_clock::now();
    revision_ = live.revision();
    if (live.full()) {
      is_shown_ = false;
      estimate_utc_s_ = 0;
    }
    if (live.has_session()) is_shown_ = live.session().id() == session_;
    if (live.has_estimate() && live.estimate().state() == v1::LiveEstimate::STATE_READY) {
      estimate_utc_s_ = static_cast<double>(live.estimate().time().seconds()) +
                        1e-9 * live.estimate().time().nanos();
    }
    if (!is_shown_) return;
    for (const v1::LiveCamera& camera : live.cameras()) {
      auto& seen = seen_[camera.camera()];
      if (seen.empty() || seen.back().first < camera.observation_count()) {
        seen.emplace_back(camera.observation_count(), now);
      }
    }
  }

  const std::string session_;
  std::unique_ptr<v1::LiveService::Stub> stub_;
  std::string revision_;
  bool is_shown_ = false;
  double estimate_utc_s_ = 0;
  std::map<std::string, std::vector<std::pair<uint64_t, SteadyTime>>> seen_;
  std::vector<double> estimate_ages_s_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

struct Polls {
  uint64_t all = 0;
  uint64_t unchanged = 0;  // answered with the revision that the client had
  uint64_t bare = 0;       // of them, with 304 and no body
  uint64_t failed = 0;
  uint64_t previews = 0;
};

// A dashboard and further clients, each with a connection of its own.
class Clients {
 public:
  Clients(int http_port, std::vector<std::string> cameras)
      : port_(http_port), cameras_(std::move(cameras)), preview_times_(cameras_.size()) {
    for (int i = 0; i <= kPollers; ++i) {
      threads_.emplace_back([this, i] { Poll(kPollInterval * i / (kPollers + 1), i % 2 == 0); });
    }
    for (int i = 0; i < 2; ++i) threads_.emplace_back([this] { LoadPreviews(); });
  }
  ~Clients() { Stop(); }

  Polls Stop() {
    stopping_ = true;
    for (std::thread& thread : threads_) thread.join();
    threads_.clear();
    const std::lock_guard lock(mutex_);
    return polls_;
  }

 private:
  // A page asks for what has changed; a simple client asks for everything each time. Both say what
  // they have.
  void Poll(milliseconds phase, bool asks_for_changes) {
    HttpConnection connection(port_);
    std::string etag;
    SteadyTime next = std::chrono::steady_clock::now() + phase;
    for (; !stopping_; next += kPollInterval) {
      std::this_thread::sleep_until(next);
      std::string path = "/v1/live";
      if (asks_for_changes && !etag.empty()) {
        absl::StrAppend(&path, "?since_revision=", etag.substr(1, etag.size() - 2));
      }
      const auto reply = connection.Get(
          path, absl::StrCat("Accept-Encoding: gzip\r\n",
                             etag.empty() ? "" : absl::StrCat("If-None-Match: ", etag, "\r\n")));
      const std::lock_guard lock(mutex_);
      ++polls_.all;
      if (!reply.ok() || (reply->status != 200 && reply->status != 304)) {
        ++polls_.failed;
        if (!reply.ok()) return;
        continue;
      }
      const std::string now = reply->Header("ETag");
      if (now == etag) {
        ++polls_.unchanged;
        if (reply->status == 304 && reply->body.empty()) ++polls_.bare;
      }
      etag = now;
    }
  }

  void LoadPreviews() {
    HttpConnection connection(port_);
    while (!stopping_) {
      const SteadyTime now = std::chrono::steady_clock::now();
      std::string camera;
      {
        const std::lock_guard lock(mutex_);
        const auto oldest = std::ranges::min_element(preview_times_);
        if (oldest != preview_times_.end() && *oldest <= now) {
          *oldest = now + kPreviewInterval;
          camera = cameras_[static_cast<size_t>(oldest - preview_times_.begin())];
        }
      }
      if (camera.empty()) {
        std::this_thread::sleep_for(milliseconds(10));
        continue;
      }
      const auto reply = connection.Get(absl::StrCat("/v1/cameras/", camera, "/preview.jpg"));
      if (!reply.ok()) return;
      const std::lock_guard lock(mutex_);
      if (reply->status == 200 && reply->body.size() == kPreviewBytes) ++polls_.previews;
    }
  }

  const int port_;
  const std::vector<std::string> cameras_;
  std::mutex mutex_;
  std::vector<SteadyTime> preview_times_;  // when each is next asked for
  Polls polls_;
  std::atomic<bool> stopping_ = false;
  std::vector<std::thread> threads_;
};

// What was measured in one of the two conditions.
struct Measured {
  std::vector<double> ack_p50_ms, ack_p99_ms;  // of each round
  std::vector<double> visible_ms;
  std::vector<double> estimate_ages_s;
  std::vector<double> cpu_share;  // of the server, of one core
  Polls polls;
};

class LiveBench {
 public:
  explicit LiveBench(benchmark::State* state) : state_(*state) {}

  absl::Status Run() {
    SimulationOptions options;
    options.camera_count = FromEnvironmentOr("RIGCAL_LIVE_CAMERAS", 24);
    options.rate_hz = kCameraRateHz;
    options.duration_s = seconds_ + 1;
    RIGCAL_ASSIGN_OR_RETURN(SimulatedWorld world, SimulatedWorld::Create(options, BenchWand()));
    world_ = std::make_unique<SimulatedWorld>(std::move(world));
    const std::string port_file = (directory_.path() / "http_port").string();
    server_ = std::make_unique<ServerProcess>(
        directory_.path() / "store", 0, std::map<std::string, std::string>{},
        std::vector<std::string>{"--http-port-file", port_file});
    std::ifstream(port_file) >> http_port_;
    const int rounds = FromEnvironmentOr("RIGCAL_LIVE_ROUNDS", 5);
    for (int round = 0; round < rounds; ++round) {
      const bool alone_first = round % 2 == 0;
      for (const bool alone : {alone_first, !alone_first}) {
        RIGCAL_RETURN_IF_ERROR(Wave(absl::StrCat("wave-", round, alone ? "-alone" : "-polled"),
                                    !alone, alone ? &alone_ : &polled_));
      }
    }
    RIGCAL_RETURN_IF_ERROR(Idle());
    Report();
    return absl::OkStatus();
  }

 private:
  // One session, its clients, and what they meet.
  absl::Status Wave(const std::string& session, bool with_clients, Measured* measured) {
    ServerClient client(server_->address());
    LoadOptions load;
    load.address = server_->address();
    load.session_id = session;
    load.agents = static_cast<int>(world_->cameras().size());
    load.rows_per_message = 1;
    load.rows_per_s = kCameraRateHz;
    load.rows_per_agent = static_cast<uint32_t>(seconds_ * kCameraRateHz);
    load.world = world_.get();
    load.preview_jpeg = std::string(kPreviewBytes, 'j');
    Probe probe(server_->address(), session);
    std::unique_ptr<Clients> clients;
    double cpu_s = 0;
    const auto start = [&]() -> absl::Status {
      v1::CreateSessionRequest request;
      request.set_id(session);
      *request.mutable_target() = wire::ToProto(BenchWand());
      RIGCAL_RETURN_IF_ERROR(client.CreateSession(request).status());
      RIGCAL_RETURN_IF_ERROR(client.StartSession(session).status());
      if (with_clients) clients = std::make_unique<Clients>(http_port_, CameraNames());
      cpu_s = testing::CpuSeconds(server_->process().pid());
      return absl::OkStatus();
    };
    RIGCAL_ASSIGN_OR_RETURN(const LoadResult result, RunLoad(load, start));
    cpu_s = testing::CpuSeconds(server_->process().pid()) - cpu_s;
    if (clients != nullptr) {
      const Polls polls = clients->Stop();
      measured->polls.all += polls.all;
      measured->polls.failed += polls.failed;
      measured->polls.previews += polls.previews;
    }
    probe.Stop();
    measured->ack_p50_ms.push_back(1e3 * QuantileOf(result.ack_latency_s, 0.5));
    measured->ack_p99_ms.push_back(1e3 * QuantileOf(result.ack_latency_s, 0.99));
    measured->cpu_share.push_back(cpu_s / result.duration_s);
    for (size_t i = 0; i < result.acknowledged.size(); ++i) {
      const std::vector<double> visible_ms =
          probe.VisibleMs(CameraNames()[i], result.acknowledged[i]);
      measured->visible_ms.insert(measured->visible_ms.end(), visible_ms.begin(), visible_ms.end());
    }
    measured->estimate_ages_s.insert(measured->estimate_ages_s.end(),
                                     probe.estimate_ages_s().begin(),
                                     probe.estimate_ages_s().end());
    RIGCAL_RETURN_IF_ERROR(client.StopSession(session, 0.1).status());
    return client.WaitUntilFinished(session).status();
  }

  // Nothing changes: without clients, and with them.
  absl::Status Idle() {
    const auto length = std::chrono::duration<double>(seconds_);
    // Until the last rates and alerts have gone.
    std::this_thread::sleep_for(std::chrono::duration<double>(std::clamp(2 * seconds_, 3.0, 8.0)));
    const pid_t pid = server_->process().pid();
    double before_s = testing::CpuSeconds(pid);
    std::this_thread::sleep_for(length);
    const double alone_s = testing::CpuSeconds(pid) - before_s;
    Clients clients(http_port_, {});
    std::this_thread::sleep_for(std::chrono::seconds(1));  // each has the state
    before_s = testing::CpuSeconds(pid);
    std::this_thread::sleep_for(length);
    idle_poller_share_ =
        (testing::CpuSeconds(pid) - before_s - alone_s) / seconds_ / (kPollers + 1);
    idle_ = clients.Stop();
    return idle_.failed == 0 ? absl::OkStatus()
                             : absl::UnavailableError(absl::StrCat(idle_.failed, " polls failed"));
  }

  void Report() {
    const auto median = [](const std::vector<double>& values) { return QuantileOf(values, 0.5); };
    auto& counters = state_.counters;
    counters["ack_p50_alone_ms"] = median(alone_.ack_p50_ms);
    counters["ack_p50_polled_ms"] = median(polled_.ack_p50_ms);
    counters["ack_p99_alone_ms"] = median(alone_.ack_p99_ms);
    counters["ack_p99_polled_ms"] = median(polled_.ack_p99_ms);
    counters["ack_p99_ratio"] = median(polled_.ack_p99_ms) / median(alone_.ack_p99_ms);
    counters["visible_p50_ms"] = QuantileOf(polled_.visible_ms, 0.5);
    counters["visible_p95_ms"] = QuantileOf(polled_.visible_ms, 0.95);
    counters["visible_p95_alone_ms"] = QuantileOf(alone_.visible_ms, 0.95);
    counters["estimate_age_p50_s"] = QuantileOf(polled_.estimate_ages_s, 0.5);
    counters["estimate_age_p95_s"] = QuantileOf(polled_.estimate_ages_s, 0.95);
    counters["estimate_age_p50_alone_s"] = QuantileOf(alone_.estimate_ages_s, 0.5);
    counters["server_cpu_alone_percent"] = 100 * median(alone_.cpu_share);
    counters["server_cpu_polled_percent"] = 100 * median(polled_.cpu_share);
    // With what the previews cost.
    counters["poller_cpu_percent"] =
        100 * (median(polled_.cpu_share) - median(alone_.cpu_share)) / (kPollers + 1);
    counters["idle_poller_cpu_percent"] = 100 * idle_poller_share_;
    counters["unchanged_304_share"] =
        idle_.unchanged == 0 ? 0 : double(idle_.bare) / double(idle_.unchanged);
    counters["idle_unchanged_share"] =
        idle_.all == 0 ? 0 : double(idle_.unchanged) / double(idle_.all);
    counters["polls"] = static_cast<double>(polled_.polls.all);
    counters["failed_polls"] = static_cast<double>(polled_.polls.failed);
    counters["previews"] = static_cast<double>(polled_.polls.previews);
  }

  std::vector<std::string> CameraNames() const {
    std::vector<std::string> names;
    for (const SimulatedCamera& camera : world_->cameras()) {
      names.push_back(camera.description.camera);
    }
    return names;
  }

  benchmark::State& state_;
  const double seconds_ = FromEnvironmentOr("RIGCAL_LIVE_SECONDS", 20);
  const testing::TemporaryDirectory directory_;
  std::unique_ptr<SimulatedWorld> world_;
  std::unique_ptr<ServerProcess> server_;
  int http_port_ = 0;
  Measured alone_, polled_;
  Polls idle_;
  double idle_poller_share_ = 0;
};

void PolledWave(benchmark::State& state) {
  for (auto _ : state) {
    const SteadyTime begin = std::chrono::steady_clock::now();
    const absl::Status status = LiveBench(&state).Run();
    if (!status.ok()) state.SkipWithError(status.ToString().c_str());
    if (!status.ok()) break;
    state.SetIterationTime(SecondsOf(std::chrono::steady_clock::now() - begin));
  }
}

void RegisterLive() {
  benchmark::RegisterBenchmark("live/PolledWave", PolledWave)
      ->Iterations(1)
      ->UseManualTime()
      ->Unit(benchmark::kSecond);
}

}  // namespace
}  // namespace rigcal::bench::live_bench

namespace rigcal::bench {

Suite LiveSuite() {
  return {"live", "ingest and the live state of 24 cameras, alone and with 51 clients that poll",
          live_bench::RegisterLive};
}

}  // namespace rigcal::bench
