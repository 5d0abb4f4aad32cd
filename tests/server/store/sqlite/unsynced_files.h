// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace rigcal::testing {

// What a disk holds after a power cut: of each file what was synced, and of what was written since
// then any part, in any order, torn at sectors. Files are noted as they are written; they are on
// the disk from their first sync on. Thread-safe.
class UnsyncedFiles {
 public:
  void NoteWrite(const std::string& path, std::string_view bytes, int64_t offset);
  void NoteTruncate(const std::string& path, int64_t size);
  void NoteSync(const std::string& path);
  void NoteDelete(const std::string& path);
  void Forget();

  // Gives the real files what the disk would hold. `kept`: the share of the unsynced sectors that
  // has reached the disk.
  void CutPower(double kept, uint32_t seed);

 private:
  struct Change {
    int64_t offset = 0;
    std::string bytes;
    bool truncate = false;  // to `offset`
  };
  struct File {
    std::string synced;
    bool exists = false;  // on the disk
    std::vector<Change> unsynced;
  };
  static void Apply(const Change& change, std::string* content);

  std::mutex mutex_;
  std::map<std::string, File> files_;
};

}  // namespace rigcal::testing
