// SPDX-License-Identifier: Apache-2.0
// The cost of storing, without the network: Append of 1, 64 and 512 batches to a transaction,
// reading them back, and the path through validation, queue and writer. TMPDIR chooses the disk,
// also that of the PostgreSQL server, which runs on this PC with fsync on.
#include <benchmark/benchmark.h>

#include <condition_variable>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "server/ingest/batch_validation.h"
#include "server/ingest/ingest.h"
#include "server/store/batch_blob.h"
#include "server/store/factory/open_store.h"
#include "tests/bench/suites.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/postgres_cluster.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::server::store_bench {
namespace {

using ::rigcal::testing::CapturingSession;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::MakeDelivery;
using ::rigcal::testing::PostgresCluster;
using ::rigcal::testing::TemporaryDirectory;

struct EmptyStore {
  explicit EmptyStore(bool postgresql = false) {
    if (postgresql) {
      cluster = std::make_unique<PostgresCluster>(PostgresCluster::Options{});  // fsync is on
      store = *OpenStore(cluster->NewUrl());
    } else {
      store = *OpenStore(directory.path().string());
    }
    if (!store->CreateSession(CapturingSession({"a", "b", "c", "d"})).ok()) std::abort();
  }
  TemporaryDirectory directory;
  std::unique_ptr<PostgresCluster> cluster;
  std::unique_ptr<Store> store;
};

// The next batch of a stream of equal batches.
void Advance(ObservationBatch* batch) {
  const auto rows = static_cast<uint32_t>(batch->rows());
  batch->first_seq += rows;
  for (int64_t& time_ns : batch->time_ns) time_ns += int64_t{rows} * 10'000'000;
}

void Append(benchmark::State& state, bool postgresql) {
  EmptyStore open(postgresql);
  const auto group = static_cast<size_t>(state.range(0));
  const auto rows = static_cast<uint32_t>(state.range(1));
  ObservationBatch next = MakeBatch(KeyOf("a"), 1, rows);
  std::vector<Delivery> deliveries(group);
  for (auto _ : state) {
    state.PauseTiming();
    for (Delivery& delivery : deliveries) {
      delivery = MakeDelivery(next);
      Advance(&next);
    }
    state.ResumeTiming();
    if (!open.store->Append(deliveries).ok()) std::abort();
  }
  state.SetItemsProcessed(state.iterations() * static_cast<int64_t>(group * rows));
}

void Encode(benchmark::State& state) {
  const ObservationBatch batch = MakeBatch(KeyOf("a"), 1, 16);
  std::string blob;
  for (auto _ : state) {
    EncodeBatch(batch, {}, 0, 16, &blob);
    benchmark::DoNotOptimize(blob.data());
  }
  state.SetItemsProcessed(state.iterations() * 16);
  state.counters["bytes"] = static_cast<double>(blob.size());
}

void Validate(benchmark::State& state) {
  const ObservationBatch batch = MakeBatch(KeyOf("a"), 1, 16);
  const StreamContext context{.image_size_px = {.width = 1280, .height = 1024}, .marker_count = 3};
  for (auto _ : state) {
    const auto refused_rows = ValidateBatch(context, batch);
    if (!refused_rows.ok() || !refused_rows->empty()) std::abort();
  }
  state.SetItemsProcessed(state.iterations() * 16);
}

absl::StatusOr<StreamContext> OneContext(const StreamKey&) {
  return StreamContext{.image_size_px = {.width = 1280, .height = 1024}, .marker_count = 3};
}

// One sender that keeps at most 512 batches of 16 rows unacknowledged.
void Ingest(benchmark::State& state) {
  EmptyStore open;
  server::Ingest ingest({}, open.store.get(), OneContext, nullptr);
  ingest.Start();
  std::mutex mutex;
  std::condition_variable acknowledged;
  int under_way = 0;
  ObservationBatch next = MakeBatch(KeyOf("a"), 1, 16);
  for (auto _ : state) {
    {
      std::unique_lock lock(mutex);
      acknowledged.wait(lock, [&] { return under_way < 512; });
      ++under_way;
    }
    Delivery delivery{.batch = next};
    Advance(&next);
    const auto done = [&](const absl::StatusOr<BatchAck>& ack) {
      if (!ack.ok()) std::abort();
      const std::lock_guard lock(mutex);
      if (under_way-- == 512) acknowledged.notify_one();
    };
    if (!ingest.Submit(delivery, done, nullptr).ok()) std::abort();
  }
  ingest.WaitIdle();
  state.SetItemsProcessed(state.iterations() * 16);
  state.counters["rows_per_commit"] = static_cast<double>(ingest.Stats().stored_observation_count) /
                                      static_cast<double>(ingest.Stats().commit_count);
  ingest.Shutdown();
}

void Read(benchmark::State& state) {
  EmptyStore open;
  std::vector<Delivery> deliveries;
  for (uint32_t i = 0; i < 4096; ++i) {
    deliveries.push_back(MakeDelivery(MakeBatch(KeyOf("a"), 1 + 16 * i, 16 + 16 * i)));
  }
  if (!open.store->Append(deliveries).ok()) std::abort();
  for (auto _ : state) {
    size_t rows = 0;
    const auto visit = [&](const StoredBatch& stored) {
      rows += stored.batch.rows();
      return absl::OkStatus();
    };
    if (!open.store->ReadObservations("s-test", "", visit).ok() || rows != 65536) std::abort();
  }
  state.SetItemsProcessed(state.iterations() * 65536);
}

void Register() {
  for (const bool postgresql : {false, true}) {
    if (postgresql && !PostgresCluster::Installed()) continue;
    benchmark::RegisterBenchmark(postgresql ? "store/AppendPostgres" : "store/Append", Append,
                                 postgresql)
        ->ArgNames({"batches", "rows"})
        ->Args({1, 16})
        ->Args({64, 16})
        ->Args({512, 16})
        ->Args({1, 1600})
        ->UseRealTime();
  }
  benchmark::RegisterBenchmark("store/Encode", Encode);
  benchmark::RegisterBenchmark("store/Validate", Validate);
  benchmark::RegisterBenchmark("store/Ingest", Ingest)->UseRealTime();
  benchmark::RegisterBenchmark("store/Read", Read)->UseRealTime();
}

}  // namespace
}  // namespace rigcal::server::store_bench

namespace rigcal::bench {

Suite StoreSuite() {
  return {"store", "cost of storing and reading, without the network",
          server::store_bench::Register};
}

}  // namespace rigcal::bench
