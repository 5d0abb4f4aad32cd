// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/session/stream_key.h"

// What a standby copies of a primary's store: rows of its tables, one record at a time.
namespace rigcal::server {

enum class ReplicaKind { kShared, kSession, kCalibration, kActivations };

// One row; the columns are in the order of the table's kinds: numbers, then texts and bytes.
struct ReplicaRow {
  std::vector<int64_t> numbers;  // 0 for those without a value
  uint32_t without_value = 0;    // bit i: number i has none
  std::vector<std::string> values;
};

struct ReplicaRows {
  std::string table;
  std::vector<ReplicaRow> rows;
  bool continues = false;  // the rows before were of this table, too
};

// What a table holds of a record: CRC-32 of all values in the order of the table's key; of batches
// without their content, which has its own checksums.
struct ReplicaDigest {
  std::string table;
  uint64_t row_count = 0;
  uint32_t digest = 0;

  friend bool operator==(const ReplicaDigest&, const ReplicaDigest&) = default;
};

// How many rows a standby has of a table of samples and one stream, and the key of the last.
struct ReplicaSamples {
  uint64_t count = 0;
  int64_t clock_epoch = 0;
  int64_t time_ns = 0;
};

// What a standby has of one stream. `number`: of the stream in both stores.
struct ReplicaStream {
  int64_t number = 0;
  uint32_t durable_seq = 0;
  std::array<ReplicaSamples, 3> samples = {};  // clock_sample, light_sample, host_alignment
};

struct StreamProgress {
  StreamKey stream;
  uint32_t durable_seq = 0;
  bool complete = false;  // its end is stored too
};

// A session or calibration, and whether two stores have the same of it.
struct ReplicaRecord {
  std::string id;
  uint32_t mark = 0;
  std::vector<StreamProgress> streams = {};  // of a session
};

// Everything in a store.
struct ReplicaListing {
  std::vector<ReplicaRecord> sessions;
  std::vector<ReplicaRecord> calibrations;
  std::vector<std::string> deleted_sessions;
};

// The store of a primary. Thread-safe.
class ReplicaSource {
 public:
  virtual ~ReplicaSource() = default;

  // Grows each time a standby takes over; at least 1.
  virtual absl::StatusOr<uint64_t> Generation() const = 0;
  virtual absl::StatusOr<ReplicaListing> ListReplica() const = 0;
  // Calls `take` with the rows of a record, some MB at a time; those of one call are of one state
  // of the store, and with the last call the standby has the state of that call. `streams`: what
  // the standby has already. Returns the digests of the tables in that state. NOT_FOUND: there is
  // no such record.
  virtual absl::StatusOr<std::vector<ReplicaDigest>> ReadReplica(
      ReplicaKind kind, const std::string& id, const std::vector<ReplicaStream>& streams,
      const std::function<absl::Status(std::vector<ReplicaRows>)>& take) const = 0;
};

// The store of a standby. Each call is one transaction. For one thread.
class ReplicaTarget {
 public:
  virtual ~ReplicaTarget() = default;

  // What this store has of a session.
  virtual absl::StatusOr<std::vector<ReplicaStream>> ReplicaStreams(
      const std::string& id) const = 0;
  // Its progress, for the primary's agents.
  virtual absl::StatusOr<std::vector<StreamProgress>> ReplicaProgress(
      const std::string& id) const = 0;
  // Stores a record. `read` calls its argument with rows as ReadReplica does, and returns the
  // digests. `anew`: forget what is here of it before.
  // DATA_LOSS: the rows here differ from the primary's afterwards; nothing has changed.
  using TakeRows = std::function<absl::Status(std::vector<ReplicaRows>)>;
  virtual absl::Status WriteReplica(
      ReplicaKind kind, const std::string& id, bool anew,
      const std::function<absl::StatusOr<std::vector<ReplicaDigest>>(const TakeRows&)>& read) = 0;
  virtual absl::Status EraseReplica(ReplicaKind kind, const std::string& id) = 0;
  // The next generation, which it returns.
  virtual absl::StatusOr<uint64_t> RaiseGeneration() = 0;
};

}  // namespace rigcal::server
