// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/discovery/discovery.h"

namespace rigcal::testing {

// Finds what the test has put there.
class FakeDiscovery : public Discovery {
 public:
  absl::StatusOr<std::unique_ptr<Announcement>> Announce(
      const ServerAnnouncement& /*server*/,
      std::function<void(const std::string&)> /*trouble*/) override {
    return absl::UnavailableError("a fake announces nothing");
  }
  absl::StatusOr<std::vector<FoundServer>> Find(std::chrono::milliseconds /*patience*/) override {
    ++find_count;
    return found;
  }

  absl::StatusOr<std::vector<FoundServer>> found = std::vector<FoundServer>();
  int find_count = 0;
};

}  // namespace rigcal::testing
