// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "agent/spool/disk/file_system.h"

namespace rigcal::agent {

// A file system in memory that knows what a disk would have after a power cut: of each file what
// was synced, and of the folder the names that were there at its last sync. Counts calls, lets any
// of them fail, and has a size. For one folder. Thread-safe.
class ModelFileSystem final : public FileSystem {
 public:
  // The `call`-th changing call from now on (1: the next) fails with `code`, and changes nothing
  // but, when it writes, half of the bytes. `forever`: and so do all behind it. The code of a full
  // disk: kResourceExhausted; of a broken one: kInternal.
  void FailAt(int call, absl::StatusCode code, bool forever = false);
  // The `call`-th changing call from now on throws bad_alloc, and changes nothing.
  void ThrowAt(int call);
  // From the `call`-th changing call on, the power is off: all calls fail.
  void CutPowerAt(int call);
  // What the disk has after the power cut; everything works again. With `keep_unsynced_bytes` each
  // file also has up to so many bytes that were not synced.
  void PowerCut(size_t keep_unsynced_bytes = 0);
  // The process that uses it is killed: calls fail until Thaw, and nothing is lost.
  void Freeze();
  void Thaw();
  // Bytes of all files that fit; beyond: RESOURCE_EXHAUSTED.
  void SetCapacity(uint64_t bytes);
  int calls() const;
  uint64_t bytes() const;
  uint64_t bytes_read() const;
  // Sync was called after it had failed: what must never happen.
  bool synced_again() const;

  std::vector<std::string> Names() const;
  std::string Content(const std::string& name) const;
  void SetContent(const std::string& name, std::string content);
  void Erase(const std::string& name);

  absl::Status CreateFolder(const std::string& path) override;
  absl::StatusOr<std::vector<Entry>> List(const std::string& folder) override;
  absl::StatusOr<std::shared_ptr<SpoolFile>> Create(const std::string& path) override;
  absl::StatusOr<std::shared_ptr<SpoolFile>> Open(const std::string& path) override;
  absl::Status Rename(const std::string& from, const std::string& to) override;
  absl::Status Remove(const std::string& path) override;
  absl::Status SyncFolder(const std::string& path) override;
  absl::StatusOr<std::shared_ptr<void>> Lock(const std::string& path) override;

 private:
  struct Inode {
    std::string content;
    std::string synced;
    bool sync_failed = false;
  };
  class File;

  // OK, or that this call is one that fails.
  absl::Status Pass();
  uint64_t BytesLocked() const;

  mutable std::mutex mutex_;
  std::map<std::string, std::shared_ptr<Inode>> names_;
  std::map<std::string, std::shared_ptr<Inode>> synced_names_;
  std::shared_ptr<int> lock_ = std::make_shared<int>(0);
  uint64_t capacity_ = UINT64_MAX;
  int calls_ = 0;
  uint64_t bytes_read_ = 0;
  int fail_at_ = 0;
  int throw_at_ = 0;
  absl::StatusCode code_ = absl::StatusCode::kInternal;
  bool forever_ = false;
  bool power_is_off_ = false;
  int cut_at_ = 0;
  bool synced_again_ = false;
};

}  // namespace rigcal::agent
