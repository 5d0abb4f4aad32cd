// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/session/stream_key.h"
#include "server/store/replica.h"
#include "server/store/store_changes.h"

namespace rigcal::server {

// A standby, as its primary sees it.
struct StandbyState {
  std::string address;
  bool connected = false;  // it has asked within the last seconds
  int64_t last_utc_ns = 0;
  uint64_t behind_rows = 0;
  double behind_s = 0;  // age of the oldest change that it does not have
};

// What a primary knows of its standby, and that another server has taken over. Thread-safe.
class StandbyBook {
 public:
  using Clock = std::chrono::steady_clock;
  // Is told which rows have become durable at the standby.
  using Listener = std::function<void(const std::vector<StreamProgress>&)>;

  // `changes` must outlive this object.
  explicit StandbyBook(const StoreChanges* changes) : changes_(*changes) {}

  // A standby asks; it has everything up to `position` of this run (0: of none). ALREADY_EXISTS:
  // another one has asked within the last seconds; both are named.
  absl::Status NoteAsked(const std::string& standby_id, const std::string& address,
                         uint64_t position, Clock::time_point now = Clock::now());
  // It is given the changes up to `position`, with so many rows stored in this run.
  void NoteGiven(uint64_t position, uint64_t row_count, Clock::time_point now = Clock::now());
  void NoteDurable(const std::vector<StreamProgress>& streams);

  // What the standby has of a stream; 0: nothing.
  StreamProgress Of(const StreamKey& stream) const;
  bool IsConnected(Clock::time_point now = Clock::now()) const;
  // None: no standby has asked since the start.
  std::optional<StandbyState> State(Clock::time_point now = Clock::now()) const;

  uint64_t AddListener(Listener listener);
  // It is not called any more afterwards.
  void RemoveListener(uint64_t number);

  // Called once, when another server is known to have taken over. Set it before anybody asks.
  void OnSuperseded(std::function<void(uint64_t generation, const std::string& by)> act) {
    superseded_ = std::move(act);
  }
  void Supersede(uint64_t generation, const std::string& by);

 private:
  struct Given {
    uint64_t position = 0;
    uint64_t row_count = 0;
    Clock::time_point time = {};
  };

  const StoreChanges& changes_;
  std::function<void(uint64_t, const std::string&)> superseded_;
  mutable std::mutex mutex_;
  bool is_superseded_ = false;
  std::string standby_id_;
  std::string address_;
  Clock::time_point asked_ = {};
  int64_t asked_utc_ns_ = 0;
  Given given_;    // last
  Given applied_;  // the last that it has applied
  std::map<StreamKey, StreamProgress> streams_;
  std::mutex listeners_mutex_;  // never taken while mutex_ is held
  uint64_t last_listener_ = 0;
  std::map<uint64_t, Listener> listeners_;
};

}  // namespace rigcal::server
