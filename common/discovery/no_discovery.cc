// SPDX-License-Identifier: Apache-2.0
// For builds without Avahi.
#include "common/discovery/discovery.h"

namespace rigcal {
namespace {

class NoDiscovery final : public Discovery {
 public:
  absl::StatusOr<std::unique_ptr<Announcement>> Announce(
      const ServerAnnouncement&, std::function<void(const std::string&)>) override {
    return Absent();
  }
  absl::StatusOr<std::vector<FoundServer>> Find(std::chrono::milliseconds) override {
    return Absent();
  }

 private:
  static absl::Status Absent() {
    return absl::UnavailableError(
        "this rigcal was built without mDNS; install libavahi-client-dev and build it again");
  }
};

}  // namespace

std::unique_ptr<Discovery> MakeDiscovery() { return std::make_unique<NoDiscovery>(); }

}  // namespace rigcal
