// SPDX-License-Identifier: Apache-2.0
#include "server/access/peer_conduct.h"

#include <algorithm>

namespace rigcal::server {
namespace {

// Peers that are remembered; of more, those that are neither banned nor calling are forgotten.
constexpr size_t kMaxPeers = 4096;

}  // namespace

bool PeerConduct::BeginCall(const std::string& uri, Clock::time_point now) {
  std::lock_guard lock(mutex_);
  if (by_uri_.size() >= kMaxPeers) {
    std::erase_if(by_uri_, [&](const auto& entry) {
      return entry.second.unfinished == 0 && entry.second.banned_until <= now;
    });
  }
  Record& record = by_uri_[uri];
  while (!record.seconds.empty() && record.seconds.front().begin + limits_.window < now) {
    // Streams stay open for days: a call that is older than the window counts no more.
    record.unfinished -= std::min(record.unfinished, record.seconds.front().begun);
    record.seconds.pop_front();
  }
  if (record.seconds.empty() || record.seconds.back().begin + std::chrono::seconds(1) <= now) {
    record.seconds.push_back({.begin = now});
  }
  ++record.seconds.back().begun;
  ++record.unfinished;
  return record.unfinished <= limits_.unfinished_calls;
}

void PeerConduct::EndCall(std::string_view uri) {
  std::lock_guard lock(mutex_);
  const auto found = by_uri_.find(uri);
  if (found == by_uri_.end() || found->second.unfinished == 0) return;
  --found->second.unfinished;
  // Which of them it was is not known: the oldest.
  for (Second& second : found->second.seconds) {
    if (second.begun == 0) continue;
    --second.begun;
    break;
  }
}

std::chrono::seconds PeerConduct::Ban(const std::string& uri, const std::string& why,
                                      Clock::time_point now) {
  std::lock_guard lock(mutex_);
  Record& record = by_uri_[uri];
  if (record.banned_until > now) return record.ban;
  const bool again = record.ban.count() > 0 && now - record.banned_until < limits_.forgiven_after;
  record.ban = again ? std::min(2 * record.ban, limits_.longest_ban) : limits_.first_ban;
  record.why = why;
  record.banned_until = now + record.ban;
  record.seconds.clear();
  record.unfinished = 0;
  return record.ban;
}

std::optional<PeerConduct::Banned> PeerConduct::FindBan(std::string_view uri,
                                                        Clock::time_point now) const {
  std::lock_guard lock(mutex_);
  const auto found = by_uri_.find(uri);
  if (found == by_uri_.end() || found->second.banned_until <= now) return std::nullopt;
  const auto left = std::chrono::ceil<std::chrono::seconds>(found->second.banned_until - now);
  return Banned{.why = found->second.why, .left = left};
}

}  // namespace rigcal::server
