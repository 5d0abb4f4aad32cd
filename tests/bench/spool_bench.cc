// SPDX-License-Identifier: Apache-2.0
// The agent's spool: the cost of an append, in memory and on a disk with and without a sync for
// each row, and of reading batches back. TMPDIR chooses the disk.
#include <benchmark/benchmark.h>

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>

#include "agent/spool/disk/disk_spool.h"
#include "agent/spool/memory_spool.h"
#include "tests/bench/suites.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::spool_bench {
namespace {

using ::rigcal::testing::TemporaryDirectory;

const StreamKey kStream{"s-bench", "left", 1};
constexpr uint32_t kBatchRows = 16;

Observation WandRow() {
  Observation row;
  row.markers.resize(3);
  for (MarkerObservation& marker : row.markers) {
    marker.visible = true;
    marker.centre_px = {640.25, 480.5};
  }
  return row;
}

std::unique_ptr<ObservationSpool> OpenDisk(const TemporaryDirectory& directory,
                                           std::chrono::milliseconds sync_interval) {
  DiskSpoolOptions options;
  options.folder = (directory.path() / "spool").string();
  options.sync_interval = sync_interval;
  auto spool = DiskSpool::Create(std::move(options));
  if (!spool.ok()) std::abort();
  return *std::move(spool);
}

// Rows are acknowledged in batches as an uplink does, so that the spool stays small.
void AppendTo(ObservationSpool& spool, bool reads, benchmark::State& state) {
  if (!spool.Open(kStream, 3, 1).ok()) std::abort();
  Observation row = WandRow();
  uint32_t next = 1;
  for (auto _ : state) {
    row.time_ns += 2'000'000;
    const auto seq = spool.Append(kStream, row, {});
    if (!seq.ok()) std::abort();
    if (*seq + 1 - next < kBatchRows) continue;
    // A batch ends with its segment.
    uint32_t read = next;
    while (reads && read <= *seq) {
      const auto batch = spool.Read(kStream, read, kBatchRows);
      if (!batch.ok() || batch->rows() == 0) std::abort();
      read = batch->end_seq();
    }
    next = *seq + 1;
    spool.Acknowledge(kStream, next - 1);
  }
  state.SetItemsProcessed(state.iterations());
}

void AppendMemory(benchmark::State& state) {
  MemorySpool spool;
  AppendTo(spool, false, state);
}

void AppendDisk(benchmark::State& state) {
  const TemporaryDirectory directory;
  const auto spool = OpenDisk(directory, std::chrono::milliseconds(state.range(0)));
  AppendTo(*spool, false, state);
}

void AppendAndReadDisk(benchmark::State& state) {
  const TemporaryDirectory directory;
  const auto spool = OpenDisk(directory, std::chrono::milliseconds(200));
  AppendTo(*spool, true, state);
}

void RegisterSpool() {
  benchmark::RegisterBenchmark("spool/AppendMemory", AppendMemory);
  benchmark::RegisterBenchmark("spool/AppendDisk", AppendDisk)->ArgName("sync_ms")->Arg(200);
  benchmark::RegisterBenchmark("spool/AppendDiskSynced", AppendDisk)
      ->ArgName("sync_ms")
      ->Arg(0)
      ->UseRealTime();
  benchmark::RegisterBenchmark("spool/AppendAndReadDisk", AppendAndReadDisk);
}

void PrintSpoolShare(const bench::MeasuredTimes& times) {
  constexpr char kName[] = "spool/AppendAndReadDisk";
  if (!times.Contains(kName)) return;
  // ns of CPU per row, at 6 cameras of 500 rows a second.
  std::printf("disk spool at 6 x 500/s: %.2f %% of a core\n", times.Median(kName) * 3000 * 1e-7);
}

}  // namespace
}  // namespace rigcal::agent::spool_bench

namespace rigcal::bench {

Suite SpoolSuite() {
  return {"spool", "appending to the agent's spool, in memory and on a disk",
          agent::spool_bench::RegisterSpool, agent::spool_bench::PrintSpoolShare};
}

}  // namespace rigcal::bench
