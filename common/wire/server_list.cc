// SPDX-License-Identifier: Apache-2.0
#include "common/wire/server_list.h"

#include <algorithm>
#include <cstdint>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "common/status/status_macros.h"

namespace rigcal::wire {
namespace {

constexpr size_t kMostServers = 16;

}  // namespace

absl::Status ValidateServerAddress(std::string_view address) {
  if (address.starts_with("unix:/")) return absl::OkStatus();
  if (address.starts_with("http://") || address.starts_with("https://")) {
    return absl::InvalidArgumentError(absl::StrCat(
        "'", std::string(address), "' is the address of a page; give HOST:PORT without ",
        std::string(address.substr(0, address.find("//") + 2)),
        ", and the gRPC port (7420), not that of the dashboard"));
  }
  const size_t colon = address.rfind(':');
  const std::string_view host = address.substr(0, colon);
  uint32_t port = 0;
  const bool bracketed = host.size() > 2 && host.front() == '[' && host.back() == ']';
  if (colon == std::string_view::npos || host.empty() ||
      (!bracketed && host.find_first_of(":[]/ ") != std::string_view::npos) ||
      !absl::SimpleAtoi(std::string(address.substr(colon + 1)), &port) || port == 0 ||
      port > 65535) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", std::string(address), "' is no server address; give HOST:PORT, such as ",
                     "127.0.0.1:7420", " or [::1]:7420"));
  }
  return absl::OkStatus();
}

absl::StatusOr<ServerList> ServerList::Parse(std::string_view text) {
  std::vector<std::string> servers;
  for (const absl::string_view part : absl::StrSplit(std::string(text), ',')) {
    std::string address(absl::StripAsciiWhitespace(part));
    RIGCAL_RETURN_IF_ERROR(ValidateServerAddress(address));
    if (std::ranges::find(servers, address) != servers.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat("server ", address, " stands twice in '", std::string(text), "'"));
    }
    servers.push_back(std::move(address));
  }
  return ServerList(std::move(servers));
}

bool ServerList::Learn(const std::vector<std::string>& servers) {
  const size_t before = servers_.size();
  for (const std::string& server : servers) {
    if (servers_.size() >= kMostServers) break;
    if (!ValidateServerAddress(server).ok() ||
        std::ranges::find(servers_, server) != servers_.end()) {
      continue;
    }
    servers_.push_back(server);
  }
  return servers_.size() != before;
}

std::string ServerList::text() const { return absl::StrJoin(servers_, ","); }

bool ServerList::MoveOn(std::string_view active) {
  ++moves_;
  guest_.clear();
  // Followed once in a round: two servers that name each other must not keep a client busy.
  if (!followed_ && !active.empty() && ValidateServerAddress(active).ok()) {
    followed_ = true;
    const auto listed = std::ranges::find(servers_, active);
    if (listed == servers_.end()) {
      guest_ = active;
    } else {
      index_ = static_cast<size_t>(listed - servers_.begin());
    }
    return true;
  }
  index_ = (index_ + 1) % servers_.size();
  if (moves_ < servers_.size() + (followed_ ? 1 : 0)) return true;
  Settle();
  return false;
}

}  // namespace rigcal::wire
