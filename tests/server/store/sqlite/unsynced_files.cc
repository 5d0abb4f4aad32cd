// SPDX-License-Identifier: Apache-2.0
#include "tests/server/store/sqlite/unsynced_files.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <utility>

namespace rigcal::testing {
namespace {

constexpr size_t kSector = 512;

}  // namespace

void UnsyncedFiles::NoteWrite(const std::string& path, std::string_view bytes, int64_t offset) {
  const std::lock_guard lock(mutex_);
  files_[path].unsynced.push_back({.offset = offset, .bytes = std::string(bytes)});
}

void UnsyncedFiles::NoteTruncate(const std::string& path, int64_t size) {
  const std::lock_guard lock(mutex_);
  files_[path].unsynced.push_back({.offset = size, .bytes = "", .truncate = true});
}

void UnsyncedFiles::NoteSync(const std::string& path) {
  const std::lock_guard lock(mutex_);
  File& file = files_[path];
  for (const Change& change : file.unsynced) Apply(change, &file.synced);
  file.unsynced.clear();
  file.exists = true;
}

void UnsyncedFiles::NoteDelete(const std::string& path) {
  const std::lock_guard lock(mutex_);
  files_.erase(path);
}

void UnsyncedFiles::Forget() {
  const std::lock_guard lock(mutex_);
  files_.clear();
}

void UnsyncedFiles::Apply(const Change& change, std::string* content) {
  const auto offset = static_cast<size_t>(change.offset);
  if (change.truncate) {
    content->resize(offset);
    return;
  }
  content->resize(std::max(content->size(), offset + change.bytes.size()));
  content->replace(offset, change.bytes.size(), change.bytes);
}

void UnsyncedFiles::CutPower(double kept, uint32_t seed) {
  const std::lock_guard lock(mutex_);
  std::mt19937 random(seed);
  std::bernoulli_distribution reached(kept);
  for (auto& [path, file] : files_) {
    std::string content = file.synced;
    for (const Change& change : file.unsynced) {
      if (change.truncate) {
        if (reached(random)) Apply(change, &content);
        continue;
      }
      for (size_t at = 0; at < change.bytes.size(); at += kSector) {
        if (!reached(random)) continue;
        Apply({.offset = change.offset + static_cast<int64_t>(at),
               .bytes = change.bytes.substr(at, kSector)},
              &content);
      }
    }
    if (!file.exists && content.empty()) {
      std::filesystem::remove(path);
    } else {
      std::ofstream(path, std::ios::binary | std::ios::trunc) << content;
    }
  }
  files_.clear();
}

}  // namespace rigcal::testing
