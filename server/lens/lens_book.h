// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "common/session/session.h"
#include "server/lens/session_lens.h"
#include "server/session/task_queue.h"
#include "server/store/store.h"

namespace rigcal::server {

struct LensBookOptions {
  // Lenses that are remembered; beyond them those that nobody has asked for longest are forgotten.
  size_t most_lenses = 64;
  // After a lens was made its camera rests for so many times as long, before its newer observations
  // are read.
  double rest_ratio = 1;
  std::chrono::milliseconds shortest_rest{1000};
  // Of its thread alone: observations are taken first.
  int nice = 5;
};

// Makes the lenses of cameras from sessions, one at a time on a thread of low priority, when
// somebody asks and there are observations that the last one does not have. Thread-safe.
class LensBook {
 public:
  struct Answer {
    Session session;
    CameraDescription camera;
    uint64_t stored_count = 0;  // observations of the camera in the store
    std::shared_ptr<const SessionLens> lens;
  };

  // The store outlives the book.
  explicit LensBook(const Store* store, LensBookOptions options = {});
  // Waits for the lens that is being made.
  ~LensBook() { tasks_.Shutdown(); }

  // What is known now; never waits for a lens. The errors of FindLensCamera and of the store, and
  // RESOURCE_EXHAUSTED where too many lenses are being made.
  absl::StatusOr<Answer> Get(const std::string& session_id, const std::string& camera);

  // Returns when nothing is being made.
  void WaitIdle() { tasks_.WaitIdle(); }

 private:
  using Clock = std::chrono::steady_clock;
  using Key = std::pair<std::string, std::string>;  // session, camera

  struct Entry {
    std::shared_ptr<const SessionLens> lens = std::make_shared<SessionLens>();
    uint64_t asked_count = 0;  // stored observations when it was begun
    bool begun = false;
    bool busy = false;
    Clock::time_point rest_until;
    Clock::time_point last_asked;
  };

  absl::StatusOr<Entry*> FindOrAdd(const Key& key);
  void Make(const Key& key, const Session& session, const SessionCamera& camera,
            uint64_t stored_count);
  // The lens as it is from now on, for who asks.
  void Publish(const Key& key, SessionLens lens);

  const Store& store_;
  const LensBookOptions options_;
  std::mutex mutex_;
  std::map<Key, Entry> entries_;
  TaskQueue tasks_{"lens"};
};

}  // namespace rigcal::server
