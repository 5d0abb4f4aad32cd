// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/replica.h"

namespace rigcal::server {

// What a standby says when it asks for changes.
struct ChangesQuestion {
  std::string standby_id;
  std::string process_id;
  std::string address;
  std::string server_id;  // of its data; empty: it has none
  uint64_t generation = 0;
  uint32_t schema_version = 0;
  uint64_t position = 0;
  std::string run_id;  // that `position` is of
  uint32_t wait_ms = 0;
  std::vector<StreamProgress> durable;
};

// What a primary answers.
struct ChangesAnswer {
  std::string server_id;
  uint64_t generation = 0;
  std::string run_id;
  uint64_t position = 0;
  bool all = false;  // the records below are all that it has
  bool shared = false;
  std::vector<ReplicaRecord> sessions;
  std::vector<ReplicaRecord> calibrations;
  uint64_t behind_count = 0;
};

// How a standby speaks with its primary; the RPC layer implements it. Thread-safe.
class PrimaryLink {
 public:
  virtual ~PrimaryLink() = default;
  // The errors of ReplicationService.ListChanges; UNAVAILABLE: nobody answers.
  virtual absl::StatusOr<ChangesAnswer> ListChanges(const ChangesQuestion& question) = 0;
  // As ReplicaSource::ReadReplica; `take_file` gets files of the data folder.
  virtual absl::StatusOr<std::vector<ReplicaDigest>> ReadRecord(
      ReplicaKind kind, const std::string& id, const std::vector<ReplicaStream>& streams,
      const ReplicaTarget::TakeRows& take,
      const std::function<absl::Status(const std::string& name, const std::string& content)>&
          take_file) = 0;
  // Whether a server answers there, and serves.
  virtual bool Answers() = 0;
  virtual absl::Status Supersede(const std::string& server_id, uint64_t generation,
                                 const std::string& own_address) = 0;
  // Ends calls that wait.
  virtual void Cancel() = 0;
};

}  // namespace rigcal::server
