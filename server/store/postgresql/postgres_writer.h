// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "server/store/postgresql/postgres_database.h"
#include "server/store/postgresql/postgres_start_check.h"

namespace rigcal::server {

struct PostgresWriterOptions {
  PostgresStartOptions start;
  // How long a transaction waits for a new connection where nobody knows whether its commit took
  // place; then it fails.
  std::chrono::milliseconds settle_limit{20'000};
  // Between attempts to connect again: from the first, doubled each time, up to the second.
  std::chrono::milliseconds first_pause{100};
  std::chrono::milliseconds longest_pause{5'000};
  // How long it waits for the server before this one, that was killed, to be gone.
  std::chrono::milliseconds takeover_limit{5'000};
  // ServerEntry::id of this server; empty: a command that runs by itself.
  std::string server = {};
  // ServerRoster::Turn::silent_owner: its connection is ended.
  int64_t silent_owner = 0;
};

// The one connection that writes, made anew when it is lost. Thread-safe.
//
// Every transaction changes the row of the table `writer`, which must still name this one: a server
// that was replaced by another writes nothing more. The number of the transaction in that row tells
// after a lost connection whether the commit took place; if not, the work is run again.
class PostgresWriter final : public SqlWriter {
 public:
  // Connects, checks the server, makes the tables and becomes the one that writes.
  //   ABORTED              another server was the first to take it over
  //   FAILED_PRECONDITION  as CheckPostgresServer and PreparePostgresSchema; another server uses
  //   the
  //                        database; wrong password
  //   UNAVAILABLE          nobody answers
  static absl::StatusOr<std::unique_ptr<PostgresWriter>> Open(const PostgresAddress& address,
                                                              const PostgresWriterOptions& options);

  // UNAVAILABLE: there is no connection at the moment, and nothing has changed; or, said in the
  // message, nobody knows yet whether it has. FAILED_PRECONDITION: another server writes now; every
  // later call fails too. `work` may be run more than once.
  absl::Status Transact(std::string_view what, const Work& work,
                        const std::function<void()>& on_rollback = nullptr) override;
  SqlDatabase& sql() override { return database_; }

  const std::string& server_id() const { return server_id_; }
  // Why nothing can be written at the moment; empty: it can. Never waits.
  std::string problem() const;
  // Another server writes now.
  bool replaced() const;
  // Tries to connect again where the connection is lost and no transaction runs.
  void Recover();
  // For checks while opening.
  PostgresConnection& connection() { return database_.connection(); }

 private:
  using Clock = std::chrono::steady_clock;
  PostgresWriter(const PostgresAddress& address, const PostgresWriterOptions& options)
      : options_(options), database_(address) {}

  absl::Status TakeOver();
  // Where there is no connection: one attempt, unless the last one was just now. It finds out
  // whether a commit that nobody answered took place.
  absl::Status EnsureConnected();
  absl::Status Resume();
  // The same until it is connected or `limit` has passed.
  absl::Status ConnectWithin(std::chrono::milliseconds limit);
  // Sets `committing` before the commit is sent.
  absl::Status TryTransact(const Work& work, bool* committing);
  absl::Status Fail(absl::Status status);

  const PostgresWriterOptions options_;
  std::mutex mutex_;
  PostgresDatabase database_;
  std::string server_id_;
  int64_t owner_ = 0;
  int64_t transaction_ = 0;  // the last one known to be committed
  Clock::time_point next_attempt_;
  std::chrono::milliseconds pause_{0};

  mutable std::mutex problem_mutex_;  // taken after mutex_
  absl::Status problem_;
};

}  // namespace rigcal::server
