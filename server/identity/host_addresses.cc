// SPDX-License-Identifier: Apache-2.0
#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string>

#include "common/identity/join_string.h"
#include "server/identity/server_identity.h"

namespace rigcal::server {
namespace {

struct FreeInterfaces {
  void operator()(ifaddrs* list) const { freeifaddrs(list); }
};

// Empty: not an address that others could use.
std::string AddressOf(const sockaddr* address) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (address->sa_family == AF_INET) {
    const auto* ipv4 = reinterpret_cast<const sockaddr_in*>(address);
    inet_ntop(AF_INET, &ipv4->sin_addr, text.data(), text.size());
  } else if (address->sa_family == AF_INET6) {
    const auto* ipv6 = reinterpret_cast<const sockaddr_in6*>(address);
    // It needs the name of an interface behind it, which differs on each PC.
    if (IN6_IS_ADDR_LINKLOCAL(&ipv6->sin6_addr)) return "";
    inet_ntop(AF_INET6, &ipv6->sin6_addr, text.data(), text.size());
  }
  return text.data();
}

// The addresses of interfaces that are up, IPv4 first.
std::vector<std::string> InterfaceAddresses() {
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return {};
  const std::unique_ptr<ifaddrs, FreeInterfaces> owner(list);
  std::vector<std::string> addresses;
  for (const int family : {AF_INET, AF_INET6}) {
    for (const ifaddrs* entry = list; entry != nullptr; entry = entry->ifa_next) {
      if (entry->ifa_addr == nullptr || entry->ifa_addr->sa_family != family ||
          (entry->ifa_flags & IFF_UP) == 0 || (entry->ifa_flags & IFF_LOOPBACK) != 0) {
        continue;
      }
      std::string address = AddressOf(entry->ifa_addr);
      if (!address.empty() && std::ranges::find(addresses, address) == addresses.end()) {
        addresses.push_back(std::move(address));
      }
    }
  }
  return addresses;
}

}  // namespace

std::string OwnHostName() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

bool IsLoopbackHost(const std::string& host) {
  const bool four_bytes = host.find_first_not_of("0123456789.") == std::string::npos;
  return host == "localhost" || host == "::1" || host == "[::1]" ||
         (four_bytes && host.rfind("127.", 0) == 0);
}

std::vector<std::string> ReachableHosts(const std::string& listen_host) {
  std::string host = listen_host;
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') {
    host = host.substr(1, host.size() - 2);
  }
  if (host != "0.0.0.0" && host != "::") return {host};
  std::vector<std::string> hosts = InterfaceAddresses();
  const std::string name = OwnHostName();
  if (IsHostText(name)) hosts.push_back(name);
  return hosts;
}

}  // namespace rigcal::server
