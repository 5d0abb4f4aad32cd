// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/raw_socket.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <utility>

namespace rigcal::testing {
namespace {

sockaddr_in Address(const char* host, int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  inet_pton(AF_INET, host, &address.sin_addr);
  return address;
}

}  // namespace

RawSocket::RawSocket(int port, const std::string& from)
    : descriptor_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  if (descriptor_ < 0) return;
  if (!from.empty()) {
    const sockaddr_in own = Address(from.c_str(), 0);
    if (bind(descriptor_, reinterpret_cast<const sockaddr*>(&own), sizeof(own)) != 0) Close();
  }
  const sockaddr_in server = Address("127.0.0.1", port);
  if (connect(descriptor_, reinterpret_cast<const sockaddr*>(&server), sizeof(server)) != 0) {
    Close();
  }
}

RawSocket::RawSocket(RawSocket&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)) {}

void RawSocket::Close() {
  if (descriptor_ >= 0) close(std::exchange(descriptor_, -1));
}

void RawSocket::Send(const std::string& bytes) const {
  [[maybe_unused]] const ssize_t sent = send(descriptor_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
}

std::string RawSocket::Receive(std::chrono::milliseconds limit) const {
  pollfd wait{.fd = descriptor_, .events = POLLIN, .revents = 0};
  if (poll(&wait, 1, static_cast<int>(limit.count())) <= 0) return "";
  std::array<char, 4096> buffer{};
  const ssize_t got = recv(descriptor_, buffer.data(), buffer.size(), 0);
  return got > 0 ? std::string(buffer.data(), static_cast<size_t>(got)) : "";
}

bool RawSocket::AwaitEnd(std::chrono::milliseconds limit) const {
  if (descriptor_ < 0) return true;
  const auto deadline = std::chrono::steady_clock::now() + limit;
  while (true) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        deadline - std::chrono::steady_clock::now());
    pollfd wait{.fd = descriptor_, .events = POLLIN, .revents = 0};
    if (left.count() <= 0 || poll(&wait, 1, static_cast<int>(left.count())) <= 0) return false;
    std::array<char, 4096> buffer{};
    if (recv(descriptor_, buffer.data(), buffer.size(), 0) <= 0) return true;
  }
}

}  // namespace rigcal::testing
