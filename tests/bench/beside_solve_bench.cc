// SPDX-License-Identifier: Apache-2.0
// Ingest while rigcal-worker calibrates ten million observations of six simulated cameras (as many
// as a calibration may have by default) and is ended by its memory limit: 6 agents of 500
// observations/s each, before the solve and beside it; quantiles are medians over pieces of two
// seconds. The label is the outcome of the calibration. RIGCAL_BESIDE_SOLVE_ROWS makes it
// shorter, RIGCAL_BESIDE_SOLVE_MB sets the limit.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/simulation/world/simulated_world.h"
#include "common/status/status_macros.h"
#include "common/wire/camera_wire.h"
#include "tests/bench/bench_agent.h"
#include "tests/bench/suites.h"
#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::bench::beside_solve_bench {
namespace {

using testing::ServerClient;
using testing::ServerProcess;
using testing::TemporaryDirectory;

constexpr int kCameras = 6;
constexpr double kRateHz = 500;  // of each

uint32_t FromEnvironment(const char* name, uint32_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : static_cast<uint32_t>(std::strtoul(text, nullptr, 10));
}

Target Wand() {
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  return target;
}

// Records the session "recorded" with about `row_count` observations, and finishes it.
absl::Status Record(ServerClient& client, uint32_t row_count) {
  SimulationOptions options;
  options.camera_count = kCameras;
  options.rate_hz = kRateHz;
  options.duration_s = row_count / (kCameras * kRateHz);
  RIGCAL_ASSIGN_OR_RETURN(const SimulatedWorld world, SimulatedWorld::Create(options, Wand()));
  v1::CreateSessionRequest request;
  request.set_id("recorded");
  *request.mutable_target() = wire::ToProto(Wand());
  for (const SimulatedCamera& camera : world.cameras()) {
    *request.add_cameras() = wire::ToProto(camera.description);
  }
  RIGCAL_RETURN_IF_ERROR(client.CreateSession(request).status());
  RIGCAL_RETURN_IF_ERROR(client.StartSession("recorded").status());
  constexpr size_t kBatchRows = 8192;
  for (int i = 0; i < kCameras; ++i) {
    const std::string& camera = world.cameras()[static_cast<size_t>(i)].description.camera;
    ObservationBatch batch;
    batch.stream = {"recorded", camera, 1};
    batch.marker_count = 3;
    for (int frame = 0; frame < world.FrameCount(i); ++frame) {
      batch.Append(world.Observe(i, frame));
      if (batch.rows() < kBatchRows && frame + 1 < world.FrameCount(i)) continue;
      RIGCAL_RETURN_IF_ERROR(client.Upload(batch).status());
      const uint32_t next = batch.end_seq();
      batch = ObservationBatch();
      batch.stream = {"recorded", camera, 1};
      batch.first_seq = next;
      batch.marker_count = 3;
    }
    RIGCAL_RETURN_IF_ERROR(client.UploadEnd("recorded", camera, 1, batch.first_seq - 1).status());
  }
  return client.WaitUntilFinished("recorded").status();
}

// Milliseconds from writing a message to its acknowledgement, in a session of its own.
absl::StatusOr<std::vector<double>> AckLatency(const std::string& address,
                                               const std::string& session, double duration_s) {
  ServerClient client(address);
  LoadOptions load;
  load.address = address;
  load.session_id = session;
  load.agents = kCameras;
  load.rows_per_s = kRateHz;
  load.rows_per_agent = static_cast<uint32_t>(duration_s * kRateHz) / 16 * 16;
  RIGCAL_ASSIGN_OR_RETURN(const LoadResult result, RunLoad(load, [&]() -> absl::Status {
                            v1::CreateSessionRequest request;
                            request.set_id(session);
                            *request.mutable_target() = wire::ToProto(Wand());
                            RIGCAL_RETURN_IF_ERROR(client.CreateSession(request).status());
                            return client.StartSession(session).status();
                          }));
  RIGCAL_RETURN_IF_ERROR(client.StopSession(session, 0.1).status());
  std::vector<double> latency_ms = result.ack_latency_s;
  for (double& value : latency_ms) value *= 1e3;
  return latency_ms;
}

double Quantile(std::vector<double> values, double q) {
  std::ranges::sort(values);
  return values.empty() ? 0 : values[static_cast<size_t>(q * double(values.size() - 1))];
}

// Two seconds each. A machine that stands still now and then spoils one of them, not their median.
struct Pieces {
  std::vector<double> p50_ms, p99_ms;

  absl::Status Add(const std::string& address, const std::string& session) {
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> latency_ms, AckLatency(address, session, 2));
    p50_ms.push_back(Quantile(latency_ms, 0.5));
    p99_ms.push_back(Quantile(latency_ms, 0.99));
    return absl::OkStatus();
  }
  void Report(benchmark::State& state, const std::string& when) const {
    state.counters[when + "_p50_ms"] = Quantile(p50_ms, 0.5);
    state.counters[when + "_p99_ms"] = Quantile(p99_ms, 0.5);
  }
};

absl::Status Run(benchmark::State& state) {
  const TemporaryDirectory directory;
  const std::filesystem::path config = directory.path() / "server.toml";
  std::ofstream(config) << "[limits]\ncalibration_memory_mb = "
                        << FromEnvironment("RIGCAL_BESIDE_SOLVE_MB", 3000) << "\n";
  ServerProcess server(directory.path() / "store", 0, {}, {"--config", config.string()});
  ServerClient client(server.address());
  const uint32_t rows = FromEnvironment("RIGCAL_BESIDE_SOLVE_ROWS", 9'990'000);
  RIGCAL_RETURN_IF_ERROR(Record(client, rows));
  sync();  // what has been recorded is on the disk before anything is measured
  Pieces before;
  for (int i = 0; i < 10; ++i) {
    RIGCAL_RETURN_IF_ERROR(before.Add(server.address(), absl::StrCat("before-", i)));
  }

  std::atomic<bool> ended = false;
  absl::StatusOr<v1::Calibration> calibration;
  const auto begin = std::chrono::steady_clock::now();
  std::thread solve([&] {
    calibration = ServerClient(server.address()).Calibrate("recorded", 1800);
    ended = true;
  });
  Pieces beside;
  absl::Status status;
  for (int i = 0; !ended && status.ok(); ++i) {
    status = beside.Add(server.address(), absl::StrCat("beside-", i));
  }
  solve.join();
  const std::chrono::duration<double> solve_s = std::chrono::steady_clock::now() - begin;
  RIGCAL_RETURN_IF_ERROR(status);
  RIGCAL_RETURN_IF_ERROR(calibration.status());
  state.SetIterationTime(solve_s.count());
  before.Report(state, "before");
  beside.Report(state, "beside");
  state.SetLabel(
      absl::StrCat(v1::Calibration::State_Name(calibration->state()), ": ", calibration->error()));
  return absl::OkStatus();
}

void BesideSolve(benchmark::State& state) {
  for (auto _ : state) {
    const absl::Status status = Run(state);
    if (!status.ok()) state.SkipWithError(status.ToString().c_str());
    if (!status.ok()) break;
  }
}

void RegisterBesideSolve() {
  benchmark::RegisterBenchmark("beside_solve/Ingest", BesideSolve)
      ->Iterations(1)
      ->UseManualTime()
      ->Unit(benchmark::kSecond);
}

}  // namespace
}  // namespace rigcal::bench::beside_solve_bench

namespace rigcal::bench {

Suite BesideSolveSuite() {
  return {"beside_solve", "ingest while a solve of ten million observations meets its memory limit",
          beside_solve_bench::RegisterBesideSolve};
}

}  // namespace rigcal::bench
