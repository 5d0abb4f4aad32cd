// SPDX-License-Identifier: Apache-2.0
#include <avahi-client/client.h>
#include <avahi-client/lookup.h>
#include <avahi-client/publish.h>
#include <avahi-common/alternative.h>
#include <avahi-common/domain.h>
#include <avahi-common/error.h>
#include <avahi-common/malloc.h>
#include <avahi-common/simple-watch.h>
#include <avahi-common/thread-watch.h>
#include <netinet/in.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/discovery/discovery.h"
#include "common/status/status_macros.h"
#include "common/text/printable.h"

namespace rigcal {
namespace {

constexpr char kServiceType[] = "_rigcal._tcp";
constexpr char kHttpsKey[] = "https";

template <auto Free>
struct AvahiDeleter {
  template <typename T>
  void operator()(T* object) const {
    Free(object);
  }
};
using ClientPtr = std::unique_ptr<AvahiClient, AvahiDeleter<avahi_client_free>>;
using SimplePollPtr = std::unique_ptr<AvahiSimplePoll, AvahiDeleter<avahi_simple_poll_free>>;
using ThreadedPollPtr = std::unique_ptr<AvahiThreadedPoll, AvahiDeleter<avahi_threaded_poll_free>>;

std::string NoDaemon(int error) {
  return absl::StrCat("no mDNS on this PC: ", avahi_strerror(error),
                      " (is avahi-daemon installed and running? apt install avahi-daemon)");
}

class AvahiAnnouncement final : public Discovery::Announcement {
 public:
  AvahiAnnouncement(const ServerAnnouncement& server,
                    std::function<void(const std::string&)> trouble)
      : server_(server),
        trouble_(std::move(trouble)),
        service_name_(std::string(Beginning(server.name, AVAHI_LABEL_MAX - 1))) {}
  ~AvahiAnnouncement() override {
    if (poll_) avahi_threaded_poll_stop(poll_.get());
    // A client that lost its daemon has made another one.
    if (client_ != nullptr) avahi_client_free(client_);
  }

  absl::Status Start() {
    poll_.reset(avahi_threaded_poll_new());
    if (!poll_) return absl::UnavailableError(NoDaemon(AVAHI_ERR_NO_MEMORY));
    if (const int error = Connect(); error != 0) return absl::UnavailableError(NoDaemon(error));
    avahi_threaded_poll_start(poll_.get());
    return absl::OkStatus();
  }

 private:
  // Waits for a daemon that does not run yet. Not 0: why not.
  int Connect() {
    int error = 0;
    client_ = avahi_client_new(avahi_threaded_poll_get(poll_.get()), AVAHI_CLIENT_NO_FAIL,
                               &AvahiAnnouncement::OnClient, this, &error);
    return client_ == nullptr ? error : 0;
  }

  static void OnClient(AvahiClient* client, AvahiClientState state, void* self) {
    auto& announcement = *static_cast<AvahiAnnouncement*>(self);
    announcement.client_ = client;
    announcement.Follow(state);
  }

  void Follow(AvahiClientState state) {
    if (state == AVAHI_CLIENT_S_RUNNING) return Publish();
    // The names of the PC are being settled: the daemon has taken back what it announced.
    if (group_ != nullptr && state != AVAHI_CLIENT_FAILURE) avahi_entry_group_reset(group_);
    if (state == AVAHI_CLIENT_CONNECTING) trouble_(NoDaemon(AVAHI_ERR_NO_DAEMON));
    if (state != AVAHI_CLIENT_FAILURE) return;
    int error = avahi_client_errno(client_);
    if (error == AVAHI_ERR_DISCONNECTED) {
      avahi_client_free(client_);
      client_ = nullptr;
      group_ = nullptr;
      error = Connect();
    }
    if (error != 0) trouble_(NoDaemon(error));
  }

  static void OnGroup(AvahiEntryGroup* group, AvahiEntryGroupState state, void* self) {
    auto& announcement = *static_cast<AvahiAnnouncement*>(self);
    announcement.group_ = group;
    if (state == AVAHI_ENTRY_GROUP_COLLISION) {
      announcement.Rename();
      announcement.Publish();
    } else if (state == AVAHI_ENTRY_GROUP_FAILURE) {
      announcement.trouble_(avahi_strerror(avahi_client_errno(announcement.client_)));
    }
  }

  void Rename() {
    char* const other = avahi_alternative_service_name(service_name_.c_str());
    if (other == nullptr) return;
    service_name_ = other;
    avahi_free(other);
  }

  void Publish() {
    if (group_ == nullptr) {
      group_ = avahi_entry_group_new(client_, &AvahiAnnouncement::OnGroup, this);
    }
    if (group_ == nullptr) return trouble_(avahi_strerror(avahi_client_errno(client_)));
    if (!avahi_entry_group_is_empty(group_)) avahi_entry_group_reset(group_);
    const std::string https = absl::StrCat(kHttpsKey, "=", server_.https_port);
    int error = AVAHI_ERR_COLLISION;
    constexpr int kMostNames = 100;
    for (int i = 0; i < kMostNames && error == AVAHI_ERR_COLLISION; ++i) {
      if (i > 0) Rename();  // another server on this PC has the name
      error = avahi_entry_group_add_service(group_, AVAHI_IF_UNSPEC, AVAHI_PROTO_UNSPEC,
                                            static_cast<AvahiPublishFlags>(0),
                                            service_name_.c_str(), kServiceType, nullptr, nullptr,
                                            server_.grpc_port, https.c_str(), nullptr);
    }
    if (error == 0) error = avahi_entry_group_commit(group_);
    if (error != 0) trouble_(avahi_strerror(error));
  }

  const ServerAnnouncement server_;
  const std::function<void(const std::string&)> trouble_;
  std::string service_name_;
  ThreadedPollPtr poll_;
  // Used by the thread of poll_ alone while that runs; the client owns the group.
  AvahiClient* client_ = nullptr;
  AvahiEntryGroup* group_ = nullptr;
};

// One look around.
class AvahiSearch {
 public:
  absl::StatusOr<std::vector<FoundServer>> Run(std::chrono::milliseconds patience) {
    const auto end = std::chrono::steady_clock::now() + patience;
    poll_.reset(avahi_simple_poll_new());
    int error = AVAHI_ERR_NO_MEMORY;
    if (poll_) {
      client_.reset(avahi_client_new(avahi_simple_poll_get(poll_.get()),
                                     static_cast<AvahiClientFlags>(0), &AvahiSearch::OnClient, this,
                                     &error));
    }
    if (!client_) return absl::UnavailableError(NoDaemon(error));
    // Freed with the client.
    if (avahi_service_browser_new(client_.get(), AVAHI_IF_UNSPEC, AVAHI_PROTO_UNSPEC, kServiceType,
                                  nullptr, static_cast<AvahiLookupFlags>(0),
                                  &AvahiSearch::OnService, this) == nullptr) {
      return absl::UnavailableError(NoDaemon(avahi_client_errno(client_.get())));
    }
    while (failure_.empty() && !(all_seen_ && resolving_ == 0)) {
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
          end - std::chrono::steady_clock::now());
      if (left.count() <= 0) break;
      if (avahi_simple_poll_iterate(poll_.get(), static_cast<int>(left.count())) != 0) break;
    }
    if (!failure_.empty()) return absl::UnavailableError(failure_);
    std::vector<FoundServer> servers;
    for (auto& [key, server] : found_) servers.push_back(std::move(server));
    return servers;
  }

 private:
  static void OnClient(AvahiClient* client, AvahiClientState state, void* self) {
    if (state != AVAHI_CLIENT_FAILURE) return;
    static_cast<AvahiSearch*>(self)->failure_ = NoDaemon(avahi_client_errno(client));
  }

  static void OnService(AvahiServiceBrowser* browser, AvahiIfIndex interface,
                        AvahiProtocol protocol, AvahiBrowserEvent event, const char* name,
                        const char* type, const char* domain, AvahiLookupResultFlags /*flags*/,
                        void* self) {
    auto& search = *static_cast<AvahiSearch*>(self);
    AvahiClient* const client = avahi_service_browser_get_client(browser);
    if (event == AVAHI_BROWSER_FAILURE) search.failure_ = NoDaemon(avahi_client_errno(client));
    if (event == AVAHI_BROWSER_ALL_FOR_NOW) search.all_seen_ = true;
    if (event != AVAHI_BROWSER_NEW || search.resolving_ >= kMostResolving) return;
    if (avahi_service_resolver_new(client, interface, protocol, name, type, domain,
                                   AVAHI_PROTO_UNSPEC, static_cast<AvahiLookupFlags>(0),
                                   &AvahiSearch::OnResolved, self) != nullptr) {
      ++search.resolving_;
    }
  }

  static void OnResolved(AvahiServiceResolver* resolver, AvahiIfIndex /*interface*/,
                         AvahiProtocol /*protocol*/, AvahiResolverEvent event, const char* name,
                         const char* /*type*/, const char* /*domain*/, const char* /*host_name*/,
                         const AvahiAddress* address, uint16_t port, AvahiStringList* text,
                         AvahiLookupResultFlags /*flags*/, void* self) {
    auto& search = *static_cast<AvahiSearch*>(self);
    if (event == AVAHI_RESOLVER_FOUND) search.Note(name, *address, port, HttpsPortIn(text));
    avahi_service_resolver_free(resolver);
    --search.resolving_;
  }

  // 0: it says none.
  static uint16_t HttpsPortIn(AvahiStringList* text) {
    AvahiStringList* const entry = avahi_string_list_find(text, kHttpsKey);
    char* key = nullptr;
    char* value = nullptr;
    if (entry == nullptr || avahi_string_list_get_pair(entry, &key, &value, nullptr) != 0) return 0;
    uint32_t port = 0;
    if (value == nullptr || !absl::SimpleAtoi(value, &port) || port > 65'535) port = 0;
    avahi_free(key);
    avahi_free(value);
    return static_cast<uint16_t>(port);
  }

  void Note(const char* name, const AvahiAddress& address, uint16_t grpc_port,
            uint16_t https_port) {
    // An address of one link only means nothing without the name of an interface.
    if (address.proto == AVAHI_PROTO_INET6) {
      in6_addr bytes{};
      std::memcpy(&bytes, address.data.ipv6.address, sizeof bytes);
      if (IN6_IS_ADDR_LINKLOCAL(&bytes)) return;
    }
    std::array<char, AVAHI_ADDRESS_STR_MAX> host{};
    if (avahi_address_snprint(host.data(), host.size(), &address) == nullptr) return;
    const std::string key = absl::StrCat(name, "\n", grpc_port, "\n", https_port);
    if (https_port == 0 || (!found_.contains(key) && found_.size() >= Discovery::kMostFound)) {
      return;
    }
    FoundServer& server = found_[key];
    server.name = name;
    server.grpc_port = grpc_port;
    server.https_port = https_port;
    // IPv4 first, which is easier to compare with what people know.
    const auto place =
        address.proto == AVAHI_PROTO_INET ? server.hosts.begin() : server.hosts.end();
    constexpr size_t kMostHosts = 16;
    if (server.hosts.size() < kMostHosts &&
        std::ranges::find(server.hosts, host.data()) == server.hosts.end()) {
      server.hosts.insert(place, host.data());
    }
  }

  static constexpr int kMostResolving = 256;

  std::string failure_;
  std::map<std::string, FoundServer> found_;
  int resolving_ = 0;
  bool all_seen_ = false;
  SimplePollPtr poll_;
  ClientPtr client_;  // uses the members above
};

class AvahiDiscovery final : public Discovery {
 public:
  absl::StatusOr<std::unique_ptr<Announcement>> Announce(
      const ServerAnnouncement& server, std::function<void(const std::string&)> trouble) override {
    auto announcement = std::make_unique<AvahiAnnouncement>(server, std::move(trouble));
    RIGCAL_RETURN_IF_ERROR(announcement->Start());
    return announcement;
  }
  absl::StatusOr<std::vector<FoundServer>> Find(std::chrono::milliseconds patience) override {
    return AvahiSearch().Run(patience);
  }
};

}  // namespace

std::unique_ptr<Discovery> MakeDiscovery() { return std::make_unique<AvahiDiscovery>(); }

}  // namespace rigcal
