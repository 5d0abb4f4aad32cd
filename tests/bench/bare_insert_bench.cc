// SPDX-License-Identifier: Apache-2.0
// What PostgreSQL takes at most from one connection: the bytes of the rows that the ingest
// benchmark sends, encoded beforehand, into the same table, a COMMIT for so many batches. No
// network, no checks, no counts. TMPDIR chooses the disk.
#include <benchmark/benchmark.h>

#include <cstdlib>
#include <string>
#include <vector>

#include "common/wire/observation_wire.h"
#include "server/store/batch_blob.h"
#include "server/store/postgresql/postgres_address.h"
#include "server/store/postgresql/postgres_connection.h"
#include "tests/bench/bench_agent.h"
#include "tests/bench/suites.h"
#include "tests/testing/postgres_cluster.h"

namespace rigcal::bench {
namespace {

constexpr int kRowsPerBatch = 16;

void BareInsert(benchmark::State& state) {
  using Value = server::PostgresValue;
  testing::PostgresCluster cluster(testing::PostgresCluster::Options{});  // fsync is on
  const auto address = server::PostgresAddress::Parse(cluster.Url(cluster.CreateDatabase()));
  if (!address.ok()) std::abort();
  const auto opened = server::PostgresConnection::Open(*address);
  if (!opened.ok()) std::abort();
  server::PostgresConnection& connection = **opened;
  connection.Run(
      "CREATE TABLE batch(id BIGINT PRIMARY KEY, row_count BIGINT NOT NULL, late BIGINT NOT NULL, "
      "body BYTEA NOT NULL); ALTER TABLE batch ALTER COLUMN body SET STORAGE EXTERNAL");
  v1::ConnectRequest message = BenchBatch(0, kRowsPerBatch);
  message.mutable_batch()->set_session_id("bench");
  message.mutable_batch()->set_first_seq(1);
  const auto batch = wire::FromProto(message.batch());
  if (!batch.ok()) std::abort();
  std::string body;
  server::EncodeBatch(*batch, {}, 0, kRowsPerBatch, &body);
  int64_t id = 0;
  for (auto _ : state) {
    connection.Send("BEGIN", {});
    for (int64_t i = 0; i < state.range(0); ++i) {
      connection.Send("INSERT INTO batch(id, row_count, late, body) VALUES(?,?,?,?)",
                      {Value{.number = ++id}, Value{.number = kRowsPerBatch}, Value{.number = 0},
                       Value{.kind = Value::Kind::kBlob, .blob = body}});
    }
    connection.Fetch("COMMIT", {});
  }
  const auto batches = static_cast<double>(state.iterations() * state.range(0));
  state.counters["obs/s"] =
      benchmark::Counter(kRowsPerBatch * batches, benchmark::Counter::kIsRate);
  state.counters["bytes/batch"] = static_cast<double>(body.size());
}

}  // namespace

void RegisterBareInsert() {
  if (!testing::PostgresCluster::Installed()) return;
  benchmark::RegisterBenchmark("ingest/BareInsertPostgres", BareInsert)
      ->ArgName("batches/commit")
      ->Arg(64)
      ->Arg(512)
      ->UseRealTime()
      ->Unit(benchmark::kMillisecond);
}

}  // namespace rigcal::bench
