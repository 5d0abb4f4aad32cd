// SPDX-License-Identifier: Apache-2.0
#include "server/replica/standby_book.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

namespace rigcal::server {
namespace {

// It asks at least every two seconds.
constexpr std::chrono::seconds kConnectedFor{6};

int64_t UtcNow() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace

absl::Status StandbyBook::NoteAsked(const std::string& standby_id, const std::string& address,
                                    uint64_t position, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  const bool is_other = !standby_id_.empty() && standby_id_ != standby_id;
  if (is_other && now - asked_ < kConnectedFor) {
    return absl::AlreadyExistsError(
        absl::StrCat("the standby at ", address_, " follows this server already, and ", address,
                     " asks to follow it too: one at a time. Stop one of them"));
  }
  if (is_other) {
    streams_.clear();
    applied_ = {};
    given_ = {};
  }
  standby_id_ = standby_id;
  address_ = address;
  asked_ = now;
  asked_utc_ns_ = UtcNow();
  if (position != 0 && position == given_.position) applied_ = given_;
  return absl::OkStatus();
}

void StandbyBook::NoteGiven(uint64_t position, uint64_t row_count, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  given_ = {.position = position, .row_count = row_count, .time = now};
  asked_ = now;
}

void StandbyBook::NoteDurable(const std::vector<StreamProgress>& streams) {
  if (streams.empty()) return;
  {
    const std::lock_guard lock(mutex_);
    for (const StreamProgress& stream : streams) {
      streams_.insert_or_assign(stream.stream, stream);
    }
  }
  const std::lock_guard lock(listeners_mutex_);
  for (const auto& [number, listener] : listeners_) listener(streams);
}

StreamProgress StandbyBook::Of(const StreamKey& stream) const {
  const std::lock_guard lock(mutex_);
  const auto found = streams_.find(stream);
  return found == streams_.end() ? StreamProgress{.stream = stream} : found->second;
}

bool StandbyBook::IsConnected(Clock::time_point now) const {
  const std::lock_guard lock(mutex_);
  return !standby_id_.empty() && now - asked_ < kConnectedFor;
}

std::optional<StandbyState> StandbyBook::State(Clock::time_point now) const {
  const uint64_t position = changes_.position();
  const uint64_t rows = changes_.row_count();
  const std::lock_guard lock(mutex_);
  if (standby_id_.empty()) return std::nullopt;
  StandbyState state{
      .address = address_, .connected = now - asked_ < kConnectedFor, .last_utc_ns = asked_utc_ns_};
  if (applied_.position >= position) return state;
  state.behind_rows = rows - std::min(rows, applied_.row_count);
  if (applied_.position != 0) {
    state.behind_s = std::chrono::duration<double>(now - applied_.time).count();
  }
  return state;
}

uint64_t StandbyBook::AddListener(Listener listener) {
  const std::lock_guard lock(listeners_mutex_);
  listeners_.emplace(++last_listener_, std::move(listener));
  return last_listener_;
}

void StandbyBook::RemoveListener(uint64_t number) {
  const std::lock_guard lock(listeners_mutex_);
  listeners_.erase(number);
}

void StandbyBook::Supersede(uint64_t generation, const std::string& by) {
  {
    const std::lock_guard lock(mutex_);
    if (std::exchange(is_superseded_, true)) return;
  }
  if (superseded_) superseded_(generation, by);
}

}  // namespace rigcal::server
