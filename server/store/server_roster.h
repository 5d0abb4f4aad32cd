// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal::server {

// One of the servers that share a store.
struct ServerEntry {
  std::string id = {};       // of this run of its process
  std::string host = {};     // of its PC, for people
  std::string address = {};  // HOST:PORT of gRPC
  std::string page = {};     // URL of its dashboard
  std::string version = {};  // of its software
  int64_t start_utc_ns = 0;
  // Set by the roster.
  bool active = false;       // it has the turn: it writes, and answers
  int64_t last_seen_ms = 0;  // since its last sign of life, by the database's clock
};

// A file that all servers of a store share.
struct SharedDocument {
  std::string name;                      // "identity/ca.crt"
  std::optional<std::string> text = {};  // none: there is no such file
};

// The servers of a store, of which one at a time has the turn to write and to answer clients. A
// server's entry is there as long as its roster is open; signs of life follow by themselves.
// Thread-safe.
//
// The turn is free when the connection of its holder to the database has ended, or when the holder
// gave no sign of life for kSilenceLimit, counted by whoever waits: a clock that jumps, there or in
// the database, makes nobody lose it. Whoever had it before can write nothing more (its owner
// number is in each of its transactions).
class ServerRoster {
 public:
  static constexpr int kSilenceLimitMs = 5'000;

  // Who has the turn.
  struct Turn {
    // None: it is free.
    std::optional<ServerEntry> holder = {};
    // The owner number of a holder that was silent for too long; StoreOptions takes it. 0: none.
    int64_t silent_owner = 0;
  };

  virtual ~ServerRoster() = default;
  virtual const std::string& own_id() const = 0;
  // What others are told of this server.
  virtual absl::Status Describe(ServerEntry own) = 0;
  // Call it again and again: silence is counted from call to call.
  virtual absl::StatusOr<Turn> LookAtTurn() = 0;
  // As it was a second ago: never waits. Active first, then by start.
  virtual std::vector<ServerEntry> List() = 0;

  // Documents that were written since version `*version`, which becomes that of the newest.
  virtual absl::StatusOr<std::vector<SharedDocument>> ReadDocuments(int64_t* version) = 0;
  // FAILED_PRECONDITION: this server does not have the turn.
  virtual absl::Status WriteDocuments(const std::vector<SharedDocument>& documents) = 0;
};

}  // namespace rigcal::server
