// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "server/replica/data_role.h"
#include "server/replica/primary_link.h"
#include "server/store/store.h"

namespace rigcal::server {

struct FollowerOptions {
  std::string primary;      // HOST:PORT, for messages
  std::string own_address;  // for the primary's messages
  std::filesystem::path data_dir;
  std::string process_id;
  // How long the primary may keep a question that has no answer yet.
  std::chrono::milliseconds wait{2'000};
  // Between two rounds: what has changed meanwhile goes into one.
  std::chrono::milliseconds pause{40};
  std::chrono::milliseconds retry{500};
};

struct FollowerState {
  bool complete = false;  // had everything of the primary once
  // Since the primary last answered, in seconds; below 0: it never has.
  double silence_s = -1;
  uint64_t behind_count = 0;  // rows that the primary had more, when it last answered
  uint64_t rounds = 0;        // that stored something
  std::string problem;        // why the last attempt failed; empty: it did not
};

// Copies a primary's data into a store, again and again. One thread of its own.
class Follower {
 public:
  // `store` (which has a replica_target) and `link` must outlive the follower. `role`: of the data
  // folder.
  Follower(FollowerOptions options, DataRole role, Store* store, PrimaryLink* link);
  ~Follower();

  void Start();
  void Shutdown();
  FollowerState State() const;
  // Not OK: following this primary would delete data, and nothing is copied. Waits for the first
  // answer at most `limit`; OK when there is none.
  absl::Status WaitForFirstAnswer(std::chrono::milliseconds limit);

 private:
  using Clock = std::chrono::steady_clock;

  void Run();
  absl::Status Round();
  absl::StatusOr<ChangesAnswer> Ask();
  absl::Status CheckOwnData(const ChangesAnswer& answer);
  absl::Status Take(const ChangesAnswer& answer);
  absl::Status TakeShared();
  absl::Status TakeFile(const std::string& name, const std::string& content);
  absl::Status DeleteOthers(const ReplicaListing& own, const ChangesAnswer& answer);
  // `anew_at_once`: whatever is here of it.
  absl::Status TakeRecord(ReplicaKind kind, const std::string& id, bool anew_at_once = false);
  absl::Status CheckRoom() const;
  void NoteDurable(const std::string& session);
  void Tell(const absl::Status& status);

  const FollowerOptions options_;
  Store& store_;
  ReplicaSource& own_;
  ReplicaTarget& target_;
  PrimaryLink& link_;
  // Of the following thread.
  DataRole role_;
  std::string server_id_;  // of the data here; empty: there is none
  uint64_t position_ = 0;
  std::string run_id_;
  std::vector<StreamProgress> durable_;
  bool told_other_ca_ = false;
  Clock::time_point lag_told_ = Clock::now();

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  bool stopping_ = false;
  bool answered_ = false;
  absl::Status refused_;  // CheckOwnData's
  Clock::time_point heard_ = {};
  FollowerState state_;
  std::thread thread_;
};

}  // namespace rigcal::server
