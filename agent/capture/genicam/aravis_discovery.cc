// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/aravis_discovery.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <mutex>
#include <set>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "agent/capture/genicam/aravis_objects.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// GigE Vision 1.2, 14.3.1: what a discovery acknowledgement holds behind its header.
constexpr size_t kHeaderBytes = 8;
constexpr size_t kAnswerBytes = kHeaderBytes + 0xf8;
constexpr size_t kAddressOffset = kHeaderBytes + 0x24;
constexpr size_t kVendorOffset = kHeaderBytes + 0x48;
constexpr size_t kModelOffset = kHeaderBytes + 0x68;
constexpr size_t kSerialOffset = kHeaderBytes + 0xd8;
constexpr uint16_t kControlPort = 3956;
// Key, flags (acknowledge), command 2, no payload, packet id.
constexpr std::array<uint8_t, kHeaderBytes> kDiscovery{0x42, 0x01, 0x00, 0x02, 0, 0, 0xff, 0xff};
constexpr int kMostAnswers = 1000;

struct InterfaceAddress {
  std::string name;
  in_addr address{};
  in_addr mask{};
  bool has_broadcast = false;

  bool Contains(in_addr other) const {
    return (address.s_addr & mask.s_addr) == (other.s_addr & mask.s_addr);
  }
  // Loopback has no broadcast; a camera that is a program listens at the address itself.
  in_addr Everybody() const {
    return has_broadcast ? in_addr{address.s_addr | ~mask.s_addr} : address;
  }
};

std::vector<InterfaceAddress> InterfaceAddresses() {
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return {};
  const std::unique_ptr<ifaddrs, decltype(&freeifaddrs)> owner(list, &freeifaddrs);
  std::vector<InterfaceAddress> addresses;
  for (const ifaddrs* entry = list; entry != nullptr; entry = entry->ifa_next) {
    if (entry->ifa_addr == nullptr || entry->ifa_netmask == nullptr) continue;
    if (entry->ifa_addr->sa_family != AF_INET || (entry->ifa_flags & IFF_UP) == 0) continue;
    addresses.push_back({entry->ifa_name,
                         reinterpret_cast<const sockaddr_in*>(entry->ifa_addr)->sin_addr,
                         reinterpret_cast<const sockaddr_in*>(entry->ifa_netmask)->sin_addr,
                         (entry->ifa_flags & IFF_BROADCAST) != 0});
  }
  return addresses;
}

std::string ToText(in_addr address) {
  char text[INET_ADDRSTRLEN] = "";
  inet_ntop(AF_INET, &address, text, sizeof text);
  return text;
}

// Those of one interface, or all of them if it is empty. NOT_FOUND lists the interfaces.
absl::StatusOr<std::vector<InterfaceAddress>> AddressesOf(std::string_view network_interface) {
  std::vector<InterfaceAddress> addresses = InterfaceAddresses();
  if (network_interface.empty()) return addresses;
  std::set<std::string> names;
  for (const InterfaceAddress& entry : addresses) names.insert(entry.name);
  std::erase_if(addresses, [&](const auto& entry) { return entry.name != network_interface; });
  if (!addresses.empty()) return addresses;
  return absl::NotFoundError(
      absl::StrCat("no network interface ", std::string(network_interface),
                   " with an IPv4 address is up; there are: ", absl::StrJoin(names, ", ")));
}

sockaddr_in ControlAddress(in_addr address, uint16_t port) {
  sockaddr_in result{};
  result.sin_family = AF_INET;
  result.sin_port = htons(port);
  result.sin_addr = address;
  return result;
}

// Sends the question from `local` to `remote`; every answer that comes before `limit`, at most
// `most`.
absl::StatusOr<std::vector<FoundCamera>> Ask(in_addr local, in_addr remote, bool broadcast,
                                             int most, std::chrono::milliseconds limit) {
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const auto failed = [&](const char* what) {
    return absl::UnavailableError(absl::StrCat("cannot ", what, " for GigE Vision discovery from ",
                                               ToText(local), " to ", ToText(remote), ": ",
                                               std::strerror(errno)));
  };
  if (fd < 0) return failed("open a socket");
  const absl::Cleanup close_it = [fd] { close(fd); };
  const int yes = 1;
  if (broadcast) setsockopt(fd, SOL_SOCKET, SO_BROADCAST, &yes, sizeof yes);
  const sockaddr_in from = ControlAddress(local, 0);
  if (bind(fd, reinterpret_cast<const sockaddr*>(&from), sizeof from) != 0) {
    return failed("use this address");
  }
  const sockaddr_in to = ControlAddress(remote, kControlPort);
  // Connected, a closed port is known at once instead of after the limit.
  if (!broadcast && connect(fd, reinterpret_cast<const sockaddr*>(&to), sizeof to) != 0) {
    return failed("reach it");
  }
  const ssize_t sent = broadcast ? sendto(fd, kDiscovery.data(), kDiscovery.size(), 0,
                                          reinterpret_cast<const sockaddr*>(&to), sizeof to)
                                 : send(fd, kDiscovery.data(), kDiscovery.size(), 0);
  if (sent < 0) return failed("send");

  std::vector<FoundCamera> found;
  const auto deadline = std::chrono::steady_clock::now() + limit;
  for (int answers = 0; answers < kMostAnswers && static_cast<int>(found.size()) < most;
       ++answers) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        deadline - std::chrono::steady_clock::now());
    pollfd waiting{fd, POLLIN, 0};
    if (left.count() <= 0 || poll(&waiting, 1, static_cast<int>(left.count())) <= 0) break;
    char answer[2048];
    const ssize_t size = recv(fd, answer, sizeof answer, MSG_DONTWAIT);
    if (size < 0) break;  // nobody listens there
    absl::StatusOr<FoundCamera> camera = ParseDiscoveryAnswer({answer, static_cast<size_t>(size)});
    if (camera.ok()) found.push_back(*std::move(camera));
  }
  return found;
}

std::string TextAt(std::string_view packet, size_t offset, size_t size) {
  const std::string_view field = packet.substr(offset, size);
  return std::string(field.substr(0, field.find('\0')));
}

std::string OrEmpty(const char* text) { return text == nullptr ? "" : text; }

}  // namespace

bool FoundCamera::IsNamed(std::string_view device) const {
  return !device.empty() && (device == id || device == serial || device == address);
}

std::string DescribeCameras(const std::vector<FoundCamera>& cameras) {
  if (cameras.empty()) return "none";
  return absl::StrJoin(cameras, "; ", [](std::string* out, const FoundCamera& camera) {
    absl::StrAppend(out, camera.id, " (", camera.model, camera.address.empty() ? "" : ", ",
                    camera.address, ")");
  });
}

bool IsIpv4Address(std::string_view text) {
  in_addr address{};
  return inet_pton(AF_INET, std::string(text).c_str(), &address) == 1;
}

absl::StatusOr<std::string> LocalAddressFor(std::string_view address,
                                            std::string_view network_interface) {
  in_addr remote{};
  if (inet_pton(AF_INET, std::string(address).c_str(), &remote) != 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("\"", std::string(address), "\" is not an IPv4 address"));
  }
  std::vector<std::string> networks;
  RIGCAL_ASSIGN_OR_RETURN(const auto addresses, AddressesOf(network_interface));
  for (const InterfaceAddress& entry : addresses) {
    if (entry.Contains(remote)) return ToText(entry.address);
    networks.push_back(absl::StrCat(entry.name, " ", ToText(entry.address)));
  }
  return absl::NotFoundError(absl::StrCat(
      std::string(address), " is in no network of this machine (", absl::StrJoin(networks, ", "),
      "); give the network card an address in the camera's network"));
}

absl::StatusOr<std::vector<FoundCamera>> FindCameras(const std::string& network_interface) {
  constexpr std::chrono::milliseconds kLimit(500);
  std::vector<FoundCamera> found;
  if (!network_interface.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(const auto addresses, AddressesOf(network_interface));
    for (const InterfaceAddress& entry : addresses) {
      RIGCAL_ASSIGN_OR_RETURN(
          const std::vector<FoundCamera> answers,
          Ask(entry.address, entry.Everybody(), entry.has_broadcast, kMostAnswers, kLimit));
      found.insert(found.end(), answers.begin(), answers.end());
    }
    return found;
  }
  // Aravis has one list; several cameras may be looked for at a time.
  static std::mutex aravis_list_mutex;
  const std::lock_guard lock(aravis_list_mutex);
  arv_update_device_list();
  for (unsigned int i = 0; i < arv_get_n_devices(); ++i) {
    found.push_back({.id = OrEmpty(arv_get_device_id(i)),
                     .model = OrEmpty(arv_get_device_model(i)),
                     .serial = OrEmpty(arv_get_device_serial_nbr(i)),
                     .address = OrEmpty(arv_get_device_address(i)),
                     .protocol = OrEmpty(arv_get_device_protocol(i)),
                     .vendor = OrEmpty(arv_get_device_vendor(i))});
  }
  return found;
}

void FindFakeCameraToo() { arv_enable_interface("Fake"); }

absl::StatusOr<std::optional<FoundCamera>> AskCamera(const std::string& address,
                                                     const std::string& network_interface,
                                                     std::chrono::milliseconds limit) {
  RIGCAL_ASSIGN_OR_RETURN(const std::string local_text,
                          LocalAddressFor(address, network_interface));
  in_addr local{};
  in_addr remote{};
  inet_pton(AF_INET, local_text.c_str(), &local);
  inet_pton(AF_INET, address.c_str(), &remote);
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<FoundCamera> answers,
                          Ask(local, remote, false, 1, limit));
  if (answers.empty()) return std::nullopt;
  return answers.front();
}

absl::StatusOr<FoundCamera> ParseDiscoveryAnswer(std::string_view packet) {
  if (packet.size() < kAnswerBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat("a discovery answer has ", kAnswerBytes, " bytes, not ", packet.size()));
  }
  const auto byte = [&](size_t i) { return static_cast<uint8_t>(packet[i]); };
  if (byte(0) != 0 || byte(1) != 0 || byte(2) != 0 || byte(3) != 3) {
    return absl::InvalidArgumentError("not the acknowledgement of a discovery");
  }
  in_addr address{};
  std::memcpy(&address, packet.data() + kAddressOffset, sizeof address);
  FoundCamera camera;
  camera.model = TextAt(packet, kModelOffset, 32);
  camera.serial = TextAt(packet, kSerialOffset, 16);
  camera.vendor = TextAt(packet, kVendorOffset, 32);
  camera.id = absl::StrCat(camera.vendor, "-", camera.serial);
  camera.address = ToText(address);
  camera.protocol = "GigEVision";
  return camera;
}

}  // namespace rigcal::agent
