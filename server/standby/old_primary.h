// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "server/replica/primary_link.h"

namespace rigcal::server {

// Tells the server that this one has taken over from, again and again until it has heard it: it may
// come back at any time. One thread of its own.
class OldPrimary {
 public:
  OldPrimary(std::string address, std::string server_id, uint64_t generation,
             std::string own_address);
  ~OldPrimary();

 private:
  void Run();

  const std::string address_;
  const std::string server_id_;
  const uint64_t generation_;
  const std::string own_address_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool stopping_ = false;
  std::shared_ptr<PrimaryLink> link_;
  std::thread thread_;
};

}  // namespace rigcal::server
