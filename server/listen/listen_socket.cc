// SPDX-License-Identifier: Apache-2.0
#include "server/listen/listen_socket.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <memory>

#include "absl/status/status.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

constexpr int kBacklog = 1024;

absl::Status CannotListen(const std::string& address, const std::string& why,
                          const std::string& advice) {
  return absl::UnavailableError(
      absl::StrCat("cannot listen on ", address, ": ", why, "; ", advice));
}

// After bind or listen has failed with `error`.
absl::Status CannotBind(const std::string& address, const std::string& port, int error) {
  const std::string why = std::strerror(error);
  switch (error) {
    case EADDRINUSE:
      return CannotListen(
          address, why,
          absl::StrCat("is another rigcal-server running? `ss -ltnp 'sport = :", port,
                       "'` as root names the program that holds port ", port,
                       ". Stop it, or choose another port with --listen (port 0 takes any free "
                       "one)"));
    case EADDRNOTAVAIL:
      return CannotListen(address, why,
                          "this PC has no such address: `ip address` lists those it has, and "
                          "--listen 0.0.0.0 takes them all");
    case EACCES:
      return CannotListen(address, why,
                          "ports below 1024 are for root: choose another with --listen");
    default:
      return CannotListen(address, why, "choose another address or port with --listen");
  }
}

// An IPv4 address that came over an IPv6 socket, as IPv4.
sockaddr_storage Unmapped(const sockaddr_storage& address) {
  if (address.ss_family != AF_INET6) return address;
  const auto& six = reinterpret_cast<const sockaddr_in6&>(address);
  if (!IN6_IS_ADDR_V4MAPPED(&six.sin6_addr)) return address;
  sockaddr_storage result{};
  auto& four = reinterpret_cast<sockaddr_in&>(result);
  four.sin_family = AF_INET;
  four.sin_port = six.sin6_port;
  std::memcpy(&four.sin_addr, six.sin6_addr.s6_addr + 12, 4);
  return result;
}

std::string HostText(const sockaddr_storage& address) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  const void* host =
      address.ss_family == AF_INET
          ? static_cast<const void*>(&reinterpret_cast<const sockaddr_in&>(address).sin_addr)
          : &reinterpret_cast<const sockaddr_in6&>(address).sin6_addr;
  inet_ntop(address.ss_family, host, text.data(), text.size());
  return text.data();
}

bool IsInternet(const sockaddr_storage& address) {
  return address.ss_family == AF_INET || address.ss_family == AF_INET6;
}

}  // namespace

absl::StatusOr<HostPort> ParseHostPort(const std::string& address) {
  const size_t colon = address.rfind(':');
  int port = -1;
  if (colon == std::string::npos || colon == 0 ||
      !absl::SimpleAtoi(address.substr(colon + 1), &port) || port < 0 || port > 65535) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the listen address '", address, "' is not HOST:PORT; an example is 127.0.0.1:7420"));
  }
  HostPort result{address.substr(0, colon), address.substr(colon + 1)};
  if (result.host.size() > 2 && result.host.front() == '[' && result.host.back() == ']') {
    result.host = result.host.substr(1, result.host.size() - 2);
  }
  return result;
}

std::string WithPort(const std::string& address, int port) {
  const bool has_port = address.find(':') != std::string::npos && address.back() != ']';
  const bool is_number = address.find_first_not_of("0123456789") == std::string::npos;
  return has_port || is_number ? address : absl::StrCat(address, ":", port);
}

bool IsLoopbackAddress(const std::string& address) {
  const auto parts = ParseHostPort(address);
  if (!parts.ok()) return false;
  if (parts->host == "localhost" || parts->host == "::1") return true;
  in_addr four{};
  return inet_pton(AF_INET, parts->host.c_str(), &four) == 1 && (ntohl(four.s_addr) >> 24) == 127;
}

bool IsLoopback(const sockaddr_storage& given) {
  const sockaddr_storage address = Unmapped(given);
  if (address.ss_family == AF_INET) {
    return (ntohl(reinterpret_cast<const sockaddr_in&>(address).sin_addr.s_addr) >> 24) == 127;
  }
  return address.ss_family == AF_INET6 &&
         IN6_IS_ADDR_LOOPBACK(&reinterpret_cast<const sockaddr_in6&>(address).sin6_addr);
}

absl::StatusOr<int> ListenOn(const std::string& address) {
  RIGCAL_ASSIGN_OR_RETURN(const HostPort parts, ParseHostPort(address));
  addrinfo hints{};
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (const int error = getaddrinfo(parts.host.c_str(), parts.port.c_str(), &hints, &found);
      error != 0) {
    return CannotListen(address, gai_strerror(error),
                        "name an address of this PC with --listen, such as 127.0.0.1:7420");
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> owner(found, freeaddrinfo);
  const int descriptor =
      socket(found->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, IPPROTO_TCP);
  if (descriptor < 0) return CannotBind(address, parts.port, errno);
  const int on = 1;
  const int off = 0;
  // A port whose last server has ended a moment ago; not one that another server listens on.
  setsockopt(descriptor, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
  if (found->ai_family == AF_INET6) {
    setsockopt(descriptor, IPPROTO_IPV6, IPV6_V6ONLY, &off, sizeof(off));
  }
  if (bind(descriptor, found->ai_addr, found->ai_addrlen) != 0 ||
      listen(descriptor, kBacklog) != 0) {
    const absl::Status status = CannotBind(address, parts.port, errno);
    close(descriptor);
    return status;
  }
  return descriptor;
}

int PortOf(int descriptor) {
  sockaddr_storage address{};
  socklen_t size = sizeof(address);
  if (getsockname(descriptor, reinterpret_cast<sockaddr*>(&address), &size) != 0) return 0;
  // The port is at the same place in both families.
  return ntohs(reinterpret_cast<const sockaddr_in&>(address).sin_port);
}

absl::StatusOr<int> ListenOnFile(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string name = path.string();
  if (name.size() >= sizeof(address.sun_path)) {
    return absl::InvalidArgumentError(absl::StrCat("the path ", name,
                                                   " is too long for a socket file, at most ",
                                                   sizeof(address.sun_path) - 1, " characters"));
  }
  std::memcpy(address.sun_path, name.c_str(), name.size() + 1);
  const int descriptor = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  const auto failed = [&] {
    absl::Status status = absl::UnavailableError(
        absl::StrCat("cannot make the socket file ", name, ": ", std::strerror(errno)));
    if (descriptor >= 0) close(descriptor);
    return status;
  };
  if (descriptor < 0) return failed();
  struct stat old {};
  if (lstat(name.c_str(), &old) == 0 && S_ISSOCK(old.st_mode)) unlink(name.c_str());
  // Linux gives the file the mode of the socket: there is no moment in which others could open it.
  if (fchmod(descriptor, 0600) != 0 ||
      bind(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0 ||
      listen(descriptor, kBacklog) != 0) {
    return failed();
  }
  return descriptor;
}

std::string AddressText(const sockaddr_storage& given) {
  const sockaddr_storage address = Unmapped(given);
  if (!IsInternet(address)) return "";
  const uint16_t port = ntohs(reinterpret_cast<const sockaddr_in&>(address).sin_port);
  const std::string host = HostText(address);
  return address.ss_family == AF_INET ? absl::StrCat(host, ":", port)
                                      : absl::StrCat("[", host, "]:", port);
}

std::string AddressGroup(const sockaddr_storage& given) {
  sockaddr_storage address = Unmapped(given);
  if (!IsInternet(address)) return "";
  if (address.ss_family == AF_INET) return HostText(address);
  std::memset(reinterpret_cast<sockaddr_in6&>(address).sin6_addr.s6_addr + 8, 0, 8);
  return HostText(address) + "/64";
}

}  // namespace rigcal::server
