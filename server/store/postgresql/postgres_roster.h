// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "server/store/postgresql/postgres_database.h"
#include "server/store/postgresql/postgres_start_check.h"
#include "server/store/server_roster.h"

namespace rigcal::server {

// The roster in the tables `server` and `document`, over a connection of its own.
class PostgresRoster final : public ServerRoster {
 public:
  // Checks the server and makes the tables. Errors as PostgresWriter::Open, except that the
  // database may be in use.
  static absl::StatusOr<std::unique_ptr<PostgresRoster>> Open(const PostgresAddress& address,
                                                              const PostgresStartOptions& start,
                                                              ServerEntry own);
  ~PostgresRoster() override;

  const std::string& own_id() const override { return id_; }
  absl::Status Describe(ServerEntry own) override;
  absl::StatusOr<Turn> LookAtTurn() override;
  std::vector<ServerEntry> List() override;
  absl::StatusOr<std::vector<SharedDocument>> ReadDocuments(int64_t* version) override;
  absl::Status WriteDocuments(const std::vector<SharedDocument>& documents) override;

 private:
  using Clock = std::chrono::steady_clock;
  PostgresRoster(const PostgresAddress& address, ServerEntry own);

  // Runs `work` with a connection, made anew where it is lost.
  template <typename Work>
  absl::Status With(std::string_view what, const Work& work);
  absl::Status Enter();
  void GiveSignsOfLife();
  absl::StatusOr<std::vector<ServerEntry>> ReadList();

  const std::string id_;
  std::mutex mutex_;
  PostgresDatabase database_;
  ServerEntry own_;
  // The holder of the turn as it was at the last look, and since when it is so.
  int64_t holder_ = 0;
  int64_t holder_beat_ = -1;
  Clock::time_point beat_since_;
  std::optional<Clock::time_point> gone_since_;

  std::mutex list_mutex_;
  std::vector<ServerEntry> list_;

  std::mutex end_mutex_;
  std::condition_variable ended_;
  bool end_ = false;
  std::thread life_;
};

}  // namespace rigcal::server
