// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "server/store/postgresql/postgres_database.h"

namespace rigcal::server {

// The connection of a rigcal-worker, which writes beside the server: jobs and their calibrations,
// each guarded by its own fencing number, never the row `writer`. Made anew when it is lost.
// Thread-safe.
//
// After a lost commit nobody knows whether it took place: the caller does it again, and what it
// does is the same the second time (Store::FinishJob).
class PostgresJobWriter final : public SqlWriter {
 public:
  //   FAILED_PRECONDITION  the database is of another schema, or refuses this user
  //   NOT_FOUND            it is empty: no server has used it
  //   UNAVAILABLE          nobody answers
  static absl::StatusOr<std::unique_ptr<PostgresJobWriter>> Open(const PostgresAddress& address);

  // UNAVAILABLE: there is no connection, or it was lost. FAILED_PRECONDITION: a newer server has
  // changed the schema.
  absl::Status Transact(std::string_view what, const Work& work,
                        const std::function<void()>& on_rollback = nullptr) override;
  SqlDatabase& sql() override { return database_; }
  const std::string& server_id() const { return server_id_; }
  // Why nothing can be written at the moment; empty: it can. Never waits.
  std::string problem() const;
  // For checks while opening.
  PostgresConnection& connection() { return database_.connection(); }

 private:
  using Clock = std::chrono::steady_clock;
  explicit PostgresJobWriter(const PostgresAddress& address) : database_(address) {}
  absl::Status Connect();
  absl::Status EnsureConnected();
  absl::Status TryTransact(const Work& work);
  absl::Status Note(absl::Status status);

  std::mutex mutex_;
  PostgresDatabase database_;
  std::string server_id_;
  Clock::time_point next_attempt_;
  mutable std::mutex problem_mutex_;  // taken after mutex_
  absl::Status problem_;
};

}  // namespace rigcal::server
