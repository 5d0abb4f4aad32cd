// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/gige_controller.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "agent/capture/genicam/aravis_discovery.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr uint16_t kGvcpPort = 3956;
constexpr uint32_t kPrivilegeRegister = 0x0a00;
constexpr uint32_t kApplicationRegister = 0x0a14;
constexpr uint32_t kPrivilegeBits = 0b11;  // exclusive access, control access
constexpr uint8_t kReadRegisterAnswer = 0x81;
// What a camera says to others while one has exclusive access.
constexpr uint16_t kAccessDenied = 0x8006;

sockaddr_in GvcpAddress(const std::string& text, uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  inet_pton(AF_INET, text.c_str(), &address.sin_addr);
  return address;
}

absl::Status GvcpFault(const char* what, const std::string& address) {
  return absl::UnavailableError(absl::StrCat("cannot ", what, " the camera at ", address,
                                             ", to see who uses it: ", std::strerror(errno)));
}

// FAILED_PRECONDITION: another application has exclusive access.
absl::StatusOr<uint32_t> ReadGvcpRegister(int fd, uint32_t number, const std::string& address,
                                          std::chrono::milliseconds limit) {
  const auto byte = [&](int shift) { return static_cast<uint8_t>(number >> shift); };
  // Key, flags (acknowledge), command, four bytes follow, packet id.
  const std::array<uint8_t, 12> question{0x42, 0x01,    0x00,     0x80,     0,       4,
                                         0x10, byte(8), byte(24), byte(16), byte(8), byte(0)};
  if (send(fd, question.data(), question.size(), 0) < 0) return GvcpFault("ask", address);
  const auto deadline = std::chrono::steady_clock::now() + limit;
  while (true) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        deadline - std::chrono::steady_clock::now());
    pollfd waiting{fd, POLLIN, 0};
    if (left.count() <= 0 || poll(&waiting, 1, static_cast<int>(left.count())) <= 0) {
      return absl::UnavailableError(absl::StrCat(
          "the camera at ", address, " does not say who uses it within ", limit.count(), " ms"));
    }
    std::array<uint8_t, 64> answer{};
    const ssize_t size = recv(fd, answer.data(), answer.size(), MSG_DONTWAIT);
    if (size < 0) return GvcpFault("hear", address);
    const bool is_it = size >= 8 && answer[2] == 0 && answer[3] == kReadRegisterAnswer &&
                       answer[6] == question[6] && answer[7] == question[7];
    if (!is_it) continue;
    const auto status = static_cast<uint16_t>(answer[0] << 8 | answer[1]);
    if (status == kAccessDenied) {
      return absl::FailedPreconditionError(absl::StrCat("the camera at ", address, " is in use"));
    }
    if (status != 0 || size < 12) {
      return absl::UnavailableError(
          absl::StrCat("the camera at ", address, " does not say who uses it"));
    }
    uint32_t value = 0;
    std::memcpy(&value, answer.data() + 8, sizeof value);
    return ntohl(value);
  }
}

}  // namespace

absl::StatusOr<std::optional<std::string>> GigeControllerOf(const std::string& address,
                                                            const std::string& network_interface,
                                                            std::chrono::milliseconds limit) {
  RIGCAL_ASSIGN_OR_RETURN(const std::string local, LocalAddressFor(address, network_interface));
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return GvcpFault("open a socket for", address);
  const absl::Cleanup close_it = [fd] { close(fd); };
  const sockaddr_in from = GvcpAddress(local, 0);
  const sockaddr_in to = GvcpAddress(address, kGvcpPort);
  if (bind(fd, reinterpret_cast<const sockaddr*>(&from), sizeof from) != 0 ||
      connect(fd, reinterpret_cast<const sockaddr*>(&to), sizeof to) != 0) {
    return GvcpFault("reach", address);
  }
  constexpr char kNobodyNamed[] = "0.0.0.0";
  const absl::StatusOr<uint32_t> privilege =
      ReadGvcpRegister(fd, kPrivilegeRegister, address, limit);
  if (absl::IsFailedPrecondition(privilege.status())) return kNobodyNamed;
  RIGCAL_RETURN_IF_ERROR(privilege.status());
  if ((*privilege & kPrivilegeBits) == 0) return std::nullopt;
  const absl::StatusOr<uint32_t> holder =
      ReadGvcpRegister(fd, kApplicationRegister, address, limit);
  in_addr of_holder{};
  of_holder.s_addr = htonl(holder.value_or(0));
  char text[INET_ADDRSTRLEN] = "";
  inet_ntop(AF_INET, &of_holder, text, sizeof text);
  return text;
}

}  // namespace rigcal::agent
