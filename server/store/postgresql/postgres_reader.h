// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "server/store/postgresql/postgres_database.h"

namespace rigcal::server {

// A second connection that only reads, made anew when it is lost. Thread-safe; readers wait for
// each other.
class PostgresReader final : public SqlReader {
 public:
  static absl::StatusOr<std::unique_ptr<PostgresReader>> Open(const PostgresAddress& address);

  // In one consistent state. UNAVAILABLE: the connection is lost, and a new one fails too.
  absl::Status ReadWith(std::string_view what, const SqlWriter::Work& work) override;
  // Why reading has failed: a damaged page. Stays until the store is opened again. Never waits.
  std::string problem() const;
  // For checks while opening.
  PostgresConnection& connection() { return database_.connection(); }

 private:
  explicit PostgresReader(const PostgresAddress& address) : database_(address) {}
  absl::Status NoteFailure(absl::Status status);

  std::mutex mutex_;
  PostgresDatabase database_;
  mutable std::mutex problem_mutex_;  // taken after mutex_
  std::string problem_;
};

}  // namespace rigcal::server
