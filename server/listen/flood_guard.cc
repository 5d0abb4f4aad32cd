// SPDX-License-Identifier: Apache-2.0
#include "server/listen/flood_guard.h"

#include <algorithm>

#include "absl/strings/str_format.h"

namespace rigcal::server {
namespace {

// A keepalive PING or its answer is 17 bytes, and 22 of TLS.
constexpr double kIdleBytesPerSecond = 64;
// Headers of frames and TLS records, per byte of messages.
constexpr double kOverhead = 0.05;
// WINDOW_UPDATE frames, per byte sent: a frame of 13 bytes, and 22 of TLS, for each few KiB.
constexpr double kAnswersToSent = 1.0 / 64;
// Memory of a server that is used more and more grows, and this is no flood.
constexpr double kCalmGrowthPerSecond = 32e6;

double Growth(uint64_t now, uint64_t before) {
  return now > before ? static_cast<double>(now - before) : 0;
}

}  // namespace

bool FloodGuard::IsSlow(Account* account, Clock::time_point now) const {
  const ConnectionTraffic& traffic = account->last;
  const bool may_be =
      traffic.waiting_bytes > 0 && account->unexplained >= static_cast<double>(limits_.slow_bytes);
  if (!may_be || account->slow_since == Clock::time_point()) {
    account->slow_since = may_be ? now : Clock::time_point();
    account->slow_from = traffic.received_bytes;
    return false;
  }
  if (now - account->slow_since < limits_.slow_time) return false;
  const double read = Growth(traffic.received_bytes, account->slow_from);
  const double passed_s = std::chrono::duration<double>(now - account->slow_since).count();
  account->slow_since = now;
  account->slow_from = traffic.received_bytes;
  return read < passed_s * static_cast<double>(limits_.least_bytes_per_second);
}

std::vector<FloodGuard::Cut> FloodGuard::Look(const std::vector<ConnectionTraffic>& open,
                                              uint64_t memory_bytes, Clock::time_point now) {
  const bool first = last_look_ == Clock::time_point();
  const double passed_s = first ? 0 : std::chrono::duration<double>(now - last_look_).count();
  last_look_ = now;

  std::map<uint64_t, Account> accounts;
  std::vector<Cut> cuts;
  const Account* suspect = nullptr;  // the greatest
  const Account* greatest = nullptr;
  double offered = 0;  // bytes that flow control has let through, and no service has got
  for (const ConnectionTraffic& traffic : open) {
    const auto known = accounts_.find(traffic.id);
    Account account = known == accounts_.end() ? Account() : known->second;
    const double received = Growth(traffic.received_bytes, account.last.received_bytes);
    const double explained =
        (1 + kOverhead) * Growth(traffic.explained_bytes, account.last.explained_bytes) +
        kAnswersToSent * Growth(traffic.sent_bytes, account.last.sent_bytes) +
        kIdleBytesPerSecond * passed_s;
    account.last = traffic;
    account.unexplained = std::max(0.0, account.unexplained + received - explained);
    account.received_since = account.unexplained > 0 ? account.received_since + received : 0;
    offered += std::min(account.unexplained, static_cast<double>(limits_.window_bytes));
    const bool is_slow = IsSlow(&account, now);
    const Account& kept = accounts[traffic.id] = account;
    if (is_slow) {
      cuts.push_back({.id = traffic.id,
                      .why = absl::StrFormat("%.1f MB that no call accounts for keep the server "
                                             "busy, and more waits behind them",
                                             kept.unexplained / 1e6)});
      continue;
    }
    if (kept.unexplained > static_cast<double>(limits_.unexplained_bytes)) {
      cuts.push_back({.id = traffic.id,
                      .why = absl::StrFormat("it has sent %.1f MB that no call accounts for",
                                             kept.unexplained / 1e6)});
      continue;
    }
    if (greatest == nullptr || kept.unexplained > greatest->unexplained) greatest = &kept;
    const bool is_suspect = kept.unexplained >= static_cast<double>(limits_.suspect_bytes) &&
                            kept.unexplained >= kept.received_since / 2;
    if (is_suspect && (suspect == nullptr || kept.unexplained > suspect->unexplained)) {
      suspect = &kept;
    }
  }
  accounts_ = std::move(accounts);

  const double memory = std::max(0.0, static_cast<double>(memory_bytes) - offered);
  if (first || memory < calm_memory_) calm_memory_ = memory;
  const double growth = memory - calm_memory_;
  const bool too_much = growth > static_cast<double>(limits_.most_memory_growth_bytes);
  has_suspect_ = suspect != nullptr || !cuts.empty();
  if (suspect == nullptr && too_much && greatest != nullptr &&
      greatest->unexplained >= static_cast<double>(limits_.least_bytes)) {
    suspect = greatest;
  } else if (suspect == nullptr && cuts.empty()) {
    calm_memory_ = std::min(memory, calm_memory_ + kCalmGrowthPerSecond * passed_s);
  }
  if (suspect != nullptr && growth > static_cast<double>(limits_.memory_growth_bytes)) {
    cuts.push_back(
        {.id = suspect->last.id,
         .why = absl::StrFormat("the server's memory has grown by %.0f MB while it sent %.1f MB "
                                "that no call accounts for",
                                growth / 1e6, suspect->unexplained / 1e6)});
  }
  return cuts;
}

}  // namespace rigcal::server
