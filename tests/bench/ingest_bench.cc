// SPDX-License-Identifier: Apache-2.0
// Durable ingest of one server over loopback, beside the same stream acknowledged without storing
// and the time of an fdatasync in the data directory. Columns: obs/s; ratio to the echo with the
// same agents and message size; p50 and p99 of the time from writing a message to its
// acknowledgement (at full load this is mostly the window of unacknowledged rows; the paced rows
// show the response of an unloaded server); CPU of the server process per observation. The TLS rows
// are the same with mutual TLS; of_plain is their ratio to the plain rows.
#include <benchmark/benchmark.h>
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/target/target.h"
#include "common/wire/camera_wire.h"
#include "tests/bench/bench_agent.h"
#include "tests/bench/suites.h"
#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/temporary_directory.h"
#include "tests/testing/test_ca.h"

namespace rigcal::bench::ingest_bench {
namespace {

using testing::Process;
using testing::ServerClient;
using testing::ServerProcess;
using testing::TemporaryDirectory;

double CpuSeconds(pid_t pid) {
  std::ifstream stream("/proc/" + std::to_string(pid) + "/stat");
  std::string text;
  std::getline(stream, text);
  // Fields 14 and 15 (user and system time), counted after the parenthesised name.
  std::istringstream fields(text.substr(text.rfind(')') + 2));
  std::string skipped;
  for (int i = 0; i < 11; ++i) fields >> skipped;
  double user = 0;
  double system = 0;
  fields >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

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

void Report(benchmark::State& state, const LoadResult& result, double cpu_s) {
  const double rows = static_cast<double>(result.rows);
  state.SetIterationTime(result.duration_s);
  state.counters["obs/s"] = rows / result.duration_s;
  state.counters["cpu_ns/obs"] = cpu_s * 1e9 / rows;
  const auto quantile = [&](double q) {
    return 1e3 * result.ack_latency_s[static_cast<size_t>(
                     q * static_cast<double>(result.ack_latency_s.size() - 1))];
  };
  state.counters["ack_p50_ms"] = quantile(0.5);
  state.counters["ack_p99_ms"] = quantile(0.99);
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
  for (auto _ : state) {
    const auto result = RunLoad(Load(state, "127.0.0.1:" + std::to_string(std::atoi(port))),
                                [] { return absl::OkStatus(); });
    if (!result.ok()) {
      state.SkipWithError(result.status().ToString().c_str());
      break;
    }
    Report(state, *result, CpuSeconds(pid));
    EchoRates()[KeyOf(state)] = static_cast<double>(result->rows) / result->duration_s;
  }
  close(to_child[1]);
  close(from_child[0]);
}

void RunIngest(benchmark::State& state, double rows_per_s, bool tls = false) {
  for (auto _ : state) {
    const TemporaryDirectory directory;
    const testing::TestCa ca;
    if (tls) ca.WriteServerFolder(directory.path() / "identity", ca.MakeServer());
    ServerProcess server(directory.path());
    ServerClient client(server.address());
    LoadOptions load = Load(state, server.address());
    if (tls) {
      load.credentials = [&ca](const std::string& agent_id) {
        const testing::TestCertificate own = ca.MakeAgent(agent_id);
        return grpc::SslCredentials({.pem_root_certs = ca.certificate_pem(),
                                     .pem_private_key = own.key_pem,
                                     .pem_cert_chain = own.certificate_pem});
      };
    }
    if (rows_per_s > 0) {
      load.rows_per_s = rows_per_s;
      load.rows_per_agent = static_cast<uint32_t>(4 * rows_per_s) /
                            static_cast<uint32_t>(load.rows_per_message) *
                            static_cast<uint32_t>(load.rows_per_message);
    }
    const auto result = RunLoad(load, [&]() -> absl::Status {
      v1::CreateSessionRequest request;
      request.set_id(load.session_id);
      Target target;
      target.marker_positions_m = {0, 0.13, 0.39};
      *request.mutable_target() = wire::ToProto(target);
      if (const auto created = client.CreateSession(request); !created.ok()) {
        return created.status();
      }
      return client.StartSession(load.session_id).status();
    });
    if (!result.ok()) {
      state.SkipWithError((result.status().ToString() + server.process().StandardError()).c_str());
      break;
    }
    Report(state, *result, CpuSeconds(server.process().pid()));
    if (rows_per_s > 0) continue;
    const double rate = static_cast<double>(result->rows) / result->duration_s;
    Compare(state, "of_echo", EchoRates(), rate);
    if (tls) {
      Compare(state, "of_plain", PlainRates(), rate);
    } else {
      PlainRates()[KeyOf(state)] = rate;
    }
  }
}

void Ingest(benchmark::State& state) { RunIngest(state, 0); }
void IngestTls(benchmark::State& state) { RunIngest(state, 0, /*tls=*/true); }
// Each agent at 500 observations/s, the rate of a fast event camera.
void IngestPaced(benchmark::State& state) { RunIngest(state, 500); }
void IngestPacedTls(benchmark::State& state) { RunIngest(state, 500, /*tls=*/true); }

using Run = void (*)(benchmark::State&);

void RegisterLoads(const char* name, Run run, const std::vector<std::vector<int64_t>>& loads) {
  auto* const registered = benchmark::RegisterBenchmark(name, run);
  for (const std::vector<int64_t>& load : loads) registered->Args(load);
  registered->ArgNames({"agents", "rows/message"})
      ->Iterations(1)
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond);
}

void Register() {
  const std::vector<std::vector<int64_t>> full = {{1, 16}, {1, 64}, {16, 16}, {16, 64}};
  benchmark::RegisterBenchmark("ingest/Fdatasync", Fdatasync)->Unit(benchmark::kMicrosecond);
  RegisterLoads("ingest/Echo", Echo, full);
  RegisterLoads("ingest/Ingest", Ingest, full);
  RegisterLoads("ingest/IngestTls", IngestTls, full);
  RegisterLoads("ingest/IngestPaced", IngestPaced, {{1, 16}, {16, 16}});
  RegisterLoads("ingest/IngestPacedTls", IngestPacedTls, {{1, 16}, {16, 16}});
}

}  // namespace
}  // namespace rigcal::bench::ingest_bench

namespace rigcal::bench {

Suite IngestSuite() {
  return {"ingest", "durable ingest over gRPC, against an echo server and fdatasync",
          ingest_bench::Register};
}

}  // namespace rigcal::bench
