// SPDX-License-Identifier: Apache-2.0
#include "server/store/store_changes.h"

#include <random>

#include "absl/strings/str_format.h"

namespace rigcal::server {
namespace {

std::string NewRunId() {
  std::random_device device;
  return absl::StrFormat("%08x%08x", device(), device());
}

std::vector<std::string> Beyond(const std::map<std::string, uint64_t, std::less<>>& changes,
                                uint64_t position) {
  std::vector<std::string> ids;
  for (const auto& [id, changed] : changes) {
    if (changed > position) ids.push_back(id);
  }
  return ids;
}

}  // namespace

StoreChanges::StoreChanges() : run_id_(NewRunId()) {}

uint64_t StoreChanges::Next() {
  changed_.notify_all();
  return ++position_;
}

void StoreChanges::NoteSession(std::string_view id, uint64_t rows) {
  const std::lock_guard lock(mutex_);
  rows_ += rows;
  const auto found = sessions_.find(id);
  if (found == sessions_.end()) {
    sessions_.emplace(id, Next());
  } else {
    found->second = Next();
  }
}

void StoreChanges::NoteCalibration(std::string_view id) {
  const std::lock_guard lock(mutex_);
  calibrations_.insert_or_assign(std::string(id), Next());
}

void StoreChanges::NoteShared() {
  const std::lock_guard lock(mutex_);
  shared_ = Next();
}

StoreChanges::Since StoreChanges::WaitBeyond(uint64_t position,
                                             std::chrono::milliseconds limit) const {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, limit, [&] { return ended_ || position_ > position; });
  return {.position = position_,
          .shared = shared_ > position,
          .sessions = Beyond(sessions_, position),
          .calibrations = Beyond(calibrations_, position),
          .row_count = rows_};
}

uint64_t StoreChanges::position() const {
  const std::lock_guard lock(mutex_);
  return position_;
}

uint64_t StoreChanges::row_count() const {
  const std::lock_guard lock(mutex_);
  return rows_;
}

void StoreChanges::Shutdown() {
  const std::lock_guard lock(mutex_);
  ended_ = true;
  changed_.notify_all();
}

}  // namespace rigcal::server
