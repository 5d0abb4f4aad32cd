// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>

#include "tests/server/store/sqlite/unsynced_files.h"

namespace rigcal::testing {

// SQLite's own file system, with faults at will. Registered for the life of the process; faults are
// global. Counts writes, syncs and truncations of any file opened through it. A sync that does not
// fail does nothing: tests of what a process does need not wait for the disk.
class FaultyVfs {
 public:
  static FaultyVfs& Get();
  const std::string& name() const { return name_; }

  // From the `operation`-th operation on (1: the next), one operation fails with this SQLite code;
  // `lasting`: every later one too. A failing write has written half of its bytes before.
  void FailAt(int64_t operation, int code, bool lasting);
  // The code for a failing sync; 0: the same as for writes.
  void SetSyncCode(int code) { sync_code_ = code; }
  // A write that makes its file grow asks; false: SQLITE_FULL, without counting as a fault. Null:
  // files may grow.
  void SetGrowthAllowed(std::function<bool()> allowed) { growth_allowed_ = std::move(allowed); }
  // Reads count as operations too, and can fail.
  void SetReadsFail(bool fail) { reads_fail_ = fail; }
  // Notes what is written and not synced, for power cuts. Null: does not.
  void SetModel(UnsyncedFiles* model) { model_ = model; }
  UnsyncedFiles* model() const { return model_; }
  // No faults any more.
  void Heal();

  int64_t operation_count() const { return operation_count_; }
  int64_t sync_count() const { return sync_count_; }
  // Faults that have happened since FailAt.
  int64_t fault_count() const { return fault_count_; }

  // For the file functions.
  void NoteSync() { ++sync_count_; }
  int NextFault();  // 0: go on
  int NextReadFault() { return reads_fail_ ? NextFault() : 0; }
  int SyncCode(int code) const { return sync_code_ != 0 ? sync_code_.load() : code; }
  bool MayGrow() const { return growth_allowed_ == nullptr || growth_allowed_(); }

 private:
  FaultyVfs();

  std::string name_;
  std::atomic<int64_t> operation_count_ = 0;
  std::atomic<int64_t> sync_count_ = 0;
  std::atomic<int64_t> fault_count_ = 0;
  std::atomic<int64_t> fail_at_ = 0;  // 0: never
  std::atomic<int> code_ = 0;
  std::atomic<int> sync_code_ = 0;
  std::atomic<bool> lasting_ = false;
  std::atomic<bool> reads_fail_ = false;
  std::atomic<UnsyncedFiles*> model_ = nullptr;
  std::function<bool()> growth_allowed_;
};

}  // namespace rigcal::testing
