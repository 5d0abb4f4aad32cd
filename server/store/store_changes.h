// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

namespace rigcal::server {

// Which records of a store have changed since a position, in one run of the process. Positions of
// another run say nothing: everything may have changed. Thread-safe.
class StoreChanges {
 public:
  StoreChanges();

  // Random, of this run.
  const std::string& run_id() const { return run_id_; }

  // After the change is durable. `rows`: observations that were stored with it.
  void NoteSession(std::string_view id, uint64_t rows = 0);
  void NoteCalibration(std::string_view id);
  // What is of no record: something was created, deleted or activated.
  void NoteShared();

  struct Since {
    uint64_t position = 0;
    bool shared = false;
    std::vector<std::string> sessions;
    std::vector<std::string> calibrations;
    uint64_t row_count = 0;  // observations stored in this run, up to `position`
  };
  // Waits until something is after `position`, at most `limit`.
  Since WaitBeyond(uint64_t position, std::chrono::milliseconds limit) const;
  uint64_t position() const;
  uint64_t row_count() const;
  // Ends all waiting, now and later.
  void Shutdown();

 private:
  uint64_t Next();  // with mutex_ held

  const std::string run_id_;
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  bool ended_ = false;
  uint64_t position_ = 1;
  uint64_t shared_ = 1;
  uint64_t rows_ = 0;
  std::map<std::string, uint64_t, std::less<>> sessions_;
  std::map<std::string, uint64_t, std::less<>> calibrations_;
};

}  // namespace rigcal::server
