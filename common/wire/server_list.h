// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal::wire {

// In the trailing metadata of a call that a waiting server refuses: HOST:PORT of the one that
// answers.
inline constexpr char kActiveServerKey[] = "rigcal-active-server";
// How the message of such a refusal begins.
inline constexpr char kNotActive[] = "this server is not the active one";
// In those of a server that takes over by itself when the active one is gone.
inline constexpr char kTakesOver[] = "takes over by itself";

// INVALID_ARGUMENT unless `address` is HOST:PORT, with a port from 1 to 65535, or unix:/PATH.
absl::Status ValidateServerAddress(std::string_view address);

// The servers of one rig, of which one answers at a time: "10.0.0.5:7420,10.0.0.6:7420". A client
// asks the current one, and the next where that is away or waits. Not thread-safe.
class ServerList {
 public:
  // One address or several with commas between. INVALID_ARGUMENT: one is none, or stands twice.
  static absl::StatusOr<ServerList> Parse(std::string_view text);
  // Of one address, as it is.
  static ServerList Of(std::string address) { return ServerList({std::move(address)}); }

  const std::string& current() const { return guest_.empty() ? servers_[index_] : guest_; }
  // All of it, as Parse reads it.
  std::string text() const;
  const std::vector<std::string>& servers() const { return servers_; }
  size_t size() const { return servers_.size(); }

  // Adds those that are not in it, to the end; leaves out what is no address. True: it has changed.
  bool Learn(const std::vector<std::string>& servers);

  // The current one answers: the round of MoveOn begins with it.
  void Settle() {
    moves_ = 0;
    followed_ = false;
  }
  // To `active`, which a waiting server has named and which need not be in the list, else to the
  // next. False: every server was tried since the last Settle or the last false; it is time to
  // pause.
  bool MoveOn(std::string_view active = {});

 private:
  explicit ServerList(std::vector<std::string> servers) : servers_(std::move(servers)) {}

  std::vector<std::string> servers_;  // at least one
  size_t index_ = 0;
  std::string guest_;  // the current one is this one, which is not in the list
  // In this round.
  size_t moves_ = 0;
  bool followed_ = false;  // went where a waiting server said
};

}  // namespace rigcal::wire
