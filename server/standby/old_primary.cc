// SPDX-License-Identifier: Apache-2.0
#include "server/standby/old_primary.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <utility>

#include "server/rpc/replication_client.h"

namespace rigcal::server {
namespace {

constexpr std::chrono::seconds kInterval{1};

}  // namespace

OldPrimary::OldPrimary(std::string address, std::string server_id, uint64_t generation,
                       std::string own_address)
    : address_(std::move(address)),
      server_id_(std::move(server_id)),
      generation_(generation),
      own_address_(std::move(own_address)) {
  auto link = LinkToPrimary(address_);
  if (!link.ok()) {
    spdlog::warn("the server {} that this one has taken over from is not told so: {}", address_,
                 std::string(link.status().message()));
    return;
  }
  link_ = *std::move(link);
  thread_ = std::thread([this] { Run(); });
}

OldPrimary::~OldPrimary() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    changed_.notify_all();
  }
  if (link_) link_->Cancel();
  if (thread_.joinable()) thread_.join();
}

void OldPrimary::Run() {
  while (true) {
    const absl::Status told = link_->Supersede(server_id_, generation_, own_address_);
    if (told.ok()) {
      spdlog::warn("the server {} came back and was told that this one has taken over", address_);
    }
    // Another server, or this one, is at the address now.
    if (told.ok() || absl::IsFailedPrecondition(told)) return;
    std::unique_lock lock(mutex_);
    if (changed_.wait_for(lock, kInterval, [&] { return stopping_; })) return;
  }
}

}  // namespace rigcal::server
