// SPDX-License-Identifier: Apache-2.0
// Durable ingest of one server over loopback, beside the same stream acknowledged without storing
// and the time of an fdatasync in the data directory. Columns: obs/s; ratio to the echo with the
// same agents and message size; p50 and p99 of the time from writing a message to its
// acknowledgement (at full load this is mostly the window of unacknowledged rows; the paced rows
// show the response of an unloaded server); CPU of the server process per observation. The TLS rows
// are the same with mutual TLS; those of PostgreSQL have its server on the same PC and disk,
// reached over a Unix socket, with its settings as they come (fsync and synchronous_commit on);
// of_plain is their ratio to the plain rows. DrainDiskSpool: a whole agent of six cameras delivers
// what its disk spool holds, 16 rows a message; of_memory is the ratio to the same from a spool in
// memory, of_live to six cameras of 500 observations/s. IngestFleet: row_p50_ms and row_p99_ms from
// the moment of a row until it is acknowledged, ack_p50_ms and ack_p99_ms from writing a message;
// CPU of the server per message, and of all agents together.
#include <benchmark/benchmark.h>
#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "agent/capture/observation_source.h"
#include "agent/spool/disk/disk_spool.h"
#include "agent/spool/memory_spool.h"
#include "agent/uplink/uplink.h"
#include "common/status/status_macros.h"
#include "common/target/target.h"
#include "common/wire/camera_wire.h"
#include "server/listen/descriptor_limit.h"
#include "tests/bench/bench_agent.h"
#include "tests/bench/fleet_load.h"
#include "tests/bench/suites.h"
#include "tests/testing/postgres_cluster.h"
#include "tests/testing/process.h"
#include "tests/testing/process_figures.h"
#include "tests/testing/server_client.h"
#include "tests/testing/temporary_directory.h"
#include "tests/testing/test_ca.h"

namespace rigcal::bench::ingest_bench {
namespace {

namespace fs = std::filesystem;
using testing::CpuSeconds;
using testing::Process;
using testing::ServerClient;
using testing::ServerProcess;
using testing::TemporaryDirectory;

using Rates = std::map<std::pair<int, int>, double>;

Rates& EchoRates() {
  static auto* const rates = new Rates;
  return *rates;
}
Rates& PlainRates() {
  static auto* const rates = new Rates;
  return *rates;
}

std::pair<int, int> KeyOf(const benchmark::State& state) {
  return {static_cast<int>(state.range(0)), static_cast<int>(state.range(1))};
}

// What a load reaches of another one with the same agents and message size.
void Compare(benchmark::State& state, const char* name, const Rates& rates, double rate) {
  const auto other = rates.find(KeyOf(state));
  if (other != rates.end()) state.counters[name] = rate / other->second;
}

LoadOptions Load(const benchmark::State& state, std::string address) {
  LoadOptions load;
  load.address = std::move(address);
  load.session_id = "bench";
  load.agents = static_cast<int>(state.range(0));
  load.rows_per_message = static_cast<int>(state.range(1));
  const uint32_t messages = 48'000 / static_cast<uint32_t>(load.agents);
  load.rows_per_agent = messages * static_cast<uint32_t>(load.rows_per_message);
  return load;
}

struct Measured {
  LoadResult load;
  double cpu_s = 0;  // of the server
};

// Of the run with the median rate, which is returned.
double Report(benchmark::State& state, std::vector<Measured> runs) {
  if (runs.empty()) return 0;
  std::ranges::sort(runs, {}, [](const Measured& run) { return run.load.duration_s; });
  const auto& [result, cpu_s] = runs[runs.size() / 2];
  const double rows = static_cast<double>(result.rows);
  state.counters["obs/s"] = rows / result.duration_s;
  state.counters["cpu_ns/obs"] = cpu_s * 1e9 / rows;
  const auto quantile = [&](double q) {
    return 1e3 * result.ack_latency_s[static_cast<size_t>(
                     q * static_cast<double>(result.ack_latency_s.size() - 1))];
  };
  state.counters["ack_p50_ms"] = quantile(0.5);
  state.counters["ack_p99_ms"] = quantile(0.99);
  return rows / result.duration_s;
}

void Fdatasync(benchmark::State& state) {
  const TemporaryDirectory directory;
  const int file = open((directory.path() / "x").c_str(), O_CREAT | O_WRONLY, 0600);
  const std::string page(4096, 'x');
  for (auto _ : state) {
    if (write(file, page.data(), page.size()) != 4096 || fdatasync(file) != 0) {
      state.SkipWithError("cannot write");
      break;
    }
  }
  close(file);
}

void Echo(benchmark::State& state) {
  int to_child[2];
  int from_child[2];
  if (pipe(to_child) != 0 || pipe(from_child) != 0) throw std::runtime_error("no pipe");
  const pid_t pid = fork();
  if (pid == 0) {
    dup2(to_child[0], 0);
    dup2(from_child[1], 1);
    for (const int end : {to_child[0], to_child[1], from_child[0], from_child[1]}) close(end);
    execl(RIGCAL_ECHO_SERVER, RIGCAL_ECHO_SERVER, nullptr);
    _exit(127);
  }
  close(to_child[0]);
  close(from_child[1]);
  char port[16] = {};
  if (read(from_child[0], port, sizeof(port) - 1) <= 0) throw std::runtime_error("no echo server");
  std::vector<Measured> runs;
  for (auto _ : state) {
    const double cpu_before_s = CpuSeconds(pid);
    auto result = RunLoad(Load(state, "127.0.0.1:" + std::to_string(std::atoi(port))),
                          [] { return absl::OkStatus(); });
    if (!result.ok()) {
      state.SkipWithError(result.status().ToString().c_str());
      break;
    }
    state.SetIterationTime(result->duration_s);
    runs.push_back({*std::move(result), CpuSeconds(pid) - cpu_before_s});
  }
  EchoRates()[KeyOf(state)] = Report(state, std::move(runs));
  close(to_child[1]);
  close(from_child[0]);
}

absl::Status CreateBenchSession(ServerClient& client) {
  v1::CreateSessionRequest request;
  request.set_id("bench");
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  *request.mutable_target() = wire::ToProto(target);
  return client.CreateSession(request).status();
}

// Every row is stored, and none was refused.
absl::Status CheckStored(ServerClient& client, const std::string& session_id, uint64_t rows) {
  RIGCAL_ASSIGN_OR_RETURN(const v1::Session session, client.GetSession(session_id));
  if (session.observation_count() == rows) return absl::OkStatus();
  return absl::DataLossError(
      absl::StrCat(session.observation_count(), " of ", rows, " rows are stored"));
}

struct IngestOptions {
  double rows_per_s = 0;  // of each agent; 0: as fast as it is taken
  bool tls = false;
  bool postgresql = false;
};

// A server of this bench, with what it needs.
struct BenchServer {
  explicit BenchServer(bool tls, bool postgresql) {
    if (tls) ca.WriteServerFolder(directory.path() / "data" / "identity", ca.MakeServer());
    // All agents come from one address.
    const fs::path config = directory.path() / "server.toml";
    std::ofstream(config) << "[limits]\nmax_connections_per_address = 1024\n";
    std::vector<std::string> more = {"--config", config.string()};
    if (postgresql) {
      cluster = std::make_unique<testing::PostgresCluster>(testing::PostgresCluster::Options{});
      more.insert(more.end(), {"--store", cluster->Url(cluster->CreateDatabase())});
    }
    process = std::make_unique<ServerProcess>(directory.path() / "data", 0,
                                              std::map<std::string, std::string>(), more);
  }
  double CpuSeconds() const { return testing::CpuSeconds(process->process().pid()); }

  const TemporaryDirectory directory;
  const testing::TestCa ca;
  std::unique_ptr<testing::PostgresCluster> cluster;
  std::unique_ptr<ServerProcess> process;
};

void RunIngest(benchmark::State& state, const IngestOptions& options) {
  const auto [rows_per_s, tls, postgresql] = options;
  std::vector<Measured> runs;
  for (auto _ : state) {
    const BenchServer bench_server(tls, postgresql);
    ServerProcess& server = *bench_server.process;
    ServerClient client(server.address());
    LoadOptions load = Load(state, server.address());
    if (tls) {
      load.credentials = [&ca = bench_server.ca](const std::string& agent_id) {
        const testing::TestCertificate own = ca.MakeAgent(agent_id);
        return grpc::SslCredentials({.pem_root_certs = ca.certificate_pem(),
                                     .pem_private_key = own.key_pem,
                                     .pem_cert_chain = own.certificate_pem});
      };
    }
    if (rows_per_s > 0) {
      load.rows_per_s = rows_per_s;
      constexpr double kSeconds = 4;
      load.rows_per_agent = static_cast<uint32_t>(kSeconds * rows_per_s) /
                            static_cast<uint32_t>(load.rows_per_message) *
                            static_cast<uint32_t>(load.rows_per_message);
    }
    auto result = RunLoad(load, [&]() -> absl::Status {
      RIGCAL_RETURN_IF_ERROR(CreateBenchSession(client));
      return client.StartSession(load.session_id).status();
    });
    if (!result.ok()) {
      state.SkipWithError((result.status().ToString() + server.process().StandardError()).c_str());
      break;
    }
    if (const absl::Status stored = CheckStored(client, load.session_id, result->rows);
        !stored.ok()) {
      state.SkipWithError(stored.ToString().c_str());
      break;
    }
    state.SetIterationTime(result->duration_s);
    runs.push_back({*std::move(result), bench_server.CpuSeconds()});
  }
  const double rate = Report(state, std::move(runs));
  if (rows_per_s > 0) return;
  Compare(state, "of_echo", EchoRates(), rate);
  if (tls) {
    Compare(state, "of_plain", PlainRates(), rate);
  } else if (postgresql) {
    Compare(state, "of_sqlite", PlainRates(), rate);
  } else {
    PlainRates()[KeyOf(state)] = rate;
  }
}

struct FleetSettings {
  bool postgresql = false;
  bool in_turn = true;  // as FleetOptions
};

void RunFleetOnServer(benchmark::State& state, const FleetSettings& settings) {
  for (auto _ : state) {
    const BenchServer own(/*tls=*/false, settings.postgresql);
    ServerClient client(own.process->address());
    const FleetOptions fleet{.address = own.process->address(),
                             .session_id = "bench",
                             .agents = static_cast<int>(state.range(0)),
                             .in_turn = settings.in_turn};
    double cpu_before_s = 0;
    const auto result = RunFleet(fleet, [&]() -> absl::Status {
      RIGCAL_RETURN_IF_ERROR(CreateBenchSession(client));
      RIGCAL_RETURN_IF_ERROR(client.StartSession(fleet.session_id).status());
      cpu_before_s = own.CpuSeconds();
      return absl::OkStatus();
    });
    absl::Status status = result.status();
    const double cpu_s = own.CpuSeconds() - cpu_before_s;
    if (status.ok()) status = CheckStored(client, fleet.session_id, result->rows);
    if (!status.ok()) {
      state.SkipWithError((status.ToString() + own.process->process().StandardError()).c_str());
      return;
    }
    const auto milliseconds = [](const std::vector<double>& ascending_s, double quantile) {
      return 1e3 * ascending_s[static_cast<size_t>(quantile *
                                                   static_cast<double>(ascending_s.size() - 1))];
    };
    const auto messages = static_cast<double>(result->messages);
    state.SetIterationTime(result->duration_s);
    state.counters["obs/s"] = static_cast<double>(result->rows) / result->duration_s;
    state.counters["obs/message"] = static_cast<double>(result->rows) / messages;
    state.counters["row_p50_ms"] = milliseconds(result->row_latency_s, 0.5);
    state.counters["row_p99_ms"] = milliseconds(result->row_latency_s, 0.99);
    state.counters["ack_p50_ms"] = milliseconds(result->ack_latency_s, 0.5);
    state.counters["ack_p99_ms"] = milliseconds(result->ack_latency_s, 0.99);
    state.counters["cpu_us/message"] = cpu_s * 1e6 / messages;
    state.counters["client_us/message"] = result->client_cpu_s * 1e6 / messages;
  }
}

// Yields the same observation as fast as it is asked for it, once `*may_begin`.
class FloodSource final : public agent::ObservationSource {
 public:
  FloodSource(const std::string& camera, uint32_t row_count, const std::atomic<bool>* may_begin)
      : row_count_(row_count), may_begin_(*may_begin) {
    description_.camera = camera;
    description_.image_size_px = {1280, 1024};
    description_.clock = {.clock_id = camera, .timebase = "bench"};
    row_.markers.resize(3);
    for (MarkerObservation& marker : row_.markers) {
      marker.visible = true;
      marker.centre_px = {640.25, 480.5};
    }
  }

  const CameraDescription& description() const override { return description_; }
  absl::Status Start(const Target&) override { return absl::OkStatus(); }
  absl::StatusOr<std::optional<Observation>> Next() override {
    while (!may_begin_ && !stopped_) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    if (stopped_ || given_ == row_count_) return std::nullopt;
    ++given_;
    row_.time_ns += 2'000'000;
    return row_;
  }
  void Stop() override { stopped_ = true; }

 private:
  const uint32_t row_count_;
  const std::atomic<bool>& may_begin_;
  CameraDescription description_;
  Observation row_;
  uint32_t given_ = 0;
  std::atomic<bool> stopped_ = false;
};

constexpr int kDrainCameras = 6;
constexpr uint32_t kDrainRows = 100'000;  // of each

// An agent captures everything while the server stands still. Returns the seconds from then on
// until the server has acknowledged the last row.
absl::StatusOr<double> SecondsOfDrain(ServerProcess& server, agent::ObservationSpool& spool) {
  ServerClient client(server.address());
  RIGCAL_RETURN_IF_ERROR(CreateBenchSession(client));
  std::atomic<bool> may_begin = false;
  std::vector<std::unique_ptr<agent::ObservationSource>> sources;
  for (int i = 0; i < kDrainCameras; ++i) {
    sources.push_back(std::make_unique<FloodSource>(BenchCameraName(i), kDrainRows, &may_begin));
  }
  agent::UplinkOptions options;
  options.servers = wire::ServerList::Of(server.address());
  options.agent_id = BenchAgentId(0);
  options.host = "bench";
  options.max_batch_rows = 16;
  RIGCAL_ASSIGN_OR_RETURN(const std::unique_ptr<agent::Uplink> uplink,
                          agent::Uplink::Create(std::move(options), std::move(sources), &spool,
                                                [](const std::string& address, bool) {
                                                  return agent::Uplink::MakeChannel(address);
                                                }));
  uplink->Start();
  for (bool connected = false; !connected;) {
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<v1::Agent> agents, client.ListAgents());
    connected = !agents.empty();
  }
  RIGCAL_RETURN_IF_ERROR(client.StartSession("bench").status());
  const auto wait_until = [&spool](const auto& is_so) {
    while (!is_so(spool.Streams())) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  };
  using Streams = std::vector<agent::SpooledStream>;
  wait_until([](const Streams& streams) { return streams.size() == kDrainCameras; });
  kill(server.process().pid(), SIGSTOP);
  may_begin = true;
  wait_until([](const Streams& streams) {
    return std::ranges::all_of(streams, [](const auto& stream) {
      return stream.end.has_value() && stream.synced_seq == kDrainRows;
    });
  });
  const auto begin = std::chrono::steady_clock::now();
  kill(server.process().pid(), SIGCONT);
  // A stream goes from the spool once the server has its end as well.
  wait_until([](const Streams& streams) {
    return std::ranges::all_of(streams,
                               [](const auto& stream) { return stream.durable_seq == kDrainRows; });
  });
  const std::chrono::duration<double> duration = std::chrono::steady_clock::now() - begin;
  if (uplink->Shutdown(std::chrono::seconds(10)).row_count > 0) {
    return absl::UnavailableError("the agent left rows behind");
  }
  return duration.count();
}

absl::StatusOr<double> SecondsOfDrain(bool on_disk) {
  // The server's disk is that of another PC: on one disk the two would wait for each other's syncs.
  const TemporaryDirectory server_folder("/dev/shm");
  const TemporaryDirectory spool_folder;
  ServerProcess server(server_folder.path());
  if (!on_disk) {
    agent::MemorySpool spool;
    return SecondsOfDrain(server, spool);
  }
  agent::DiskSpoolOptions options;
  options.folder = (spool_folder.path() / "spool").string();
  RIGCAL_ASSIGN_OR_RETURN(const auto spool, agent::DiskSpool::Create(std::move(options)));
  return SecondsOfDrain(server, *spool);
}

double MedianOf(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

// In turns, and each first as often as the other, so that a machine whose speed changes favours
// none.
void Drain(benchmark::State& state) {
  std::vector<double> disk_s;
  std::vector<double> of_memory;
  for (auto _ : state) {
    std::map<bool, double> seconds;
    const bool disk_first = disk_s.size() % 2 == 0;
    for (const bool on_disk : {disk_first, !disk_first}) {
      const auto one = SecondsOfDrain(on_disk);
      if (!one.ok()) {
        state.SkipWithError(one.status().ToString().c_str());
        return;
      }
      seconds[on_disk] = *one;
    }
    disk_s.push_back(seconds[true]);
    of_memory.push_back(seconds[false] / seconds[true]);
    state.SetIterationTime(seconds[true]);
  }
  const double rate = kDrainCameras * double{kDrainRows} / MedianOf(disk_s);
  state.counters["obs/s"] = rate;
  state.counters["of_memory"] = MedianOf(of_memory);
  state.counters["of_live"] = rate / (kDrainCameras * 500);
}

void Ingest(benchmark::State& state) { RunIngest(state, {}); }
void IngestTls(benchmark::State& state) { RunIngest(state, {.tls = true}); }
void IngestPostgres(benchmark::State& state) { RunIngest(state, {.postgresql = true}); }
// Each agent at 500 observations/s, the rate of a fast event camera.
void IngestPaced(benchmark::State& state) { RunIngest(state, {.rows_per_s = 500}); }
void IngestPacedTls(benchmark::State& state) { RunIngest(state, {.rows_per_s = 500, .tls = true}); }
// 16 of them: 25 000 observations/s in all.
constexpr double kManyRowsPerS = 25'000.0 / 16;
void IngestMany(benchmark::State& state) { RunIngest(state, {.rows_per_s = kManyRowsPerS}); }
void IngestManyPostgres(benchmark::State& state) {
  RunIngest(state, {.rows_per_s = kManyRowsPerS, .postgresql = true});
}

// 500 cameras of 50 frames/s, an agent and a connection each: 25 000 rows/s, and as many messages
// while the server keeps up. In turn, and with one trigger for all.
void IngestFleet(benchmark::State& state) { RunFleetOnServer(state, {}); }
void IngestFleetPostgres(benchmark::State& state) { RunFleetOnServer(state, {.postgresql = true}); }
void IngestFleetAtOnce(benchmark::State& state) { RunFleetOnServer(state, {.in_turn = false}); }

using Run = void (*)(benchmark::State&);

void RegisterLoad(const char* name, Run run, const std::vector<int64_t>& load, int runs) {
  benchmark::RegisterBenchmark(name, run)
      ->Args(load)
      ->ArgNames({"agents", "rows/message"})
      ->Iterations(runs)
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond);
}

void RegisterFleet(const char* name, Run run) {
  benchmark::RegisterBenchmark(name, run)
      ->Arg(500)
      ->ArgName("agents")
      ->Iterations(1)
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond);
}

void Register() {
  benchmark::RegisterBenchmark("ingest/Fdatasync", Fdatasync)->Unit(benchmark::kMicrosecond);
  // What is compared runs one after the other.
  const std::vector<std::vector<int64_t>> loads = {{1, 16}, {1, 64}, {16, 16}, {16, 64}};
  for (const std::vector<int64_t>& load : loads) {
    RegisterLoad("ingest/Echo", Echo, load, 5);
    RegisterLoad("ingest/Ingest", Ingest, load, 5);
    RegisterLoad("ingest/IngestTls", IngestTls, load, 5);
  }
  if (testing::PostgresCluster::Installed()) {
    RegisterLoad("ingest/IngestPostgres", IngestPostgres, {16, 16}, 5);
    RegisterLoad("ingest/IngestManyPostgres", IngestManyPostgres, {16, 16}, 1);
    RegisterFleet("ingest/IngestFleetPostgres", IngestFleetPostgres);
  }
  RegisterBareInsert();
  RegisterLoad("ingest/IngestMany", IngestMany, {16, 16}, 1);
  server::RaiseDescriptorLimit();
  RegisterFleet("ingest/IngestFleet", IngestFleet);
  RegisterFleet("ingest/IngestFleetAtOnce", IngestFleetAtOnce);
  benchmark::RegisterBenchmark("ingest/DrainDiskSpool", Drain)
      ->Iterations(8)
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond);
  for (const std::vector<int64_t>& load : {std::vector<int64_t>{1, 16}, {16, 16}}) {
    RegisterLoad("ingest/IngestPaced", IngestPaced, load, 1);
    RegisterLoad("ingest/IngestPacedTls", IngestPacedTls, load, 1);
  }
}

}  // namespace
}  // namespace rigcal::bench::ingest_bench

namespace rigcal::bench {

Suite IngestSuite() {
  return {"ingest", "durable ingest over gRPC, against an echo server and fdatasync",
          ingest_bench::Register};
}

}  // namespace rigcal::bench
