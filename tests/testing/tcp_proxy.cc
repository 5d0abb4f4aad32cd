// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/tcp_proxy.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <stdexcept>
#include <vector>

namespace rigcal::testing {
namespace {

// What one direction holds at most; then its sender waits, as behind a real link.
constexpr size_t kMaxUnsent = size_t{256} << 10;

sockaddr_in LoopbackAt(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

// Closes with a reset, so that the other side hears of it at once.
void Reset(int descriptor) {
  const linger hard{.l_onoff = 1, .l_linger = 0};
  setsockopt(descriptor, SOL_SOCKET, SO_LINGER, &hard, sizeof(hard));
  close(descriptor);
}

void SendWithoutDelay(int descriptor) {
  const int on = 1;
  setsockopt(descriptor, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
}

}  // namespace

TcpProxy::TcpProxy(int target_port) : target_port_(target_port) {
  listening_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  sockaddr_in address = LoopbackAt(0);
  socklen_t size = sizeof(address);
  if (bind(listening_, reinterpret_cast<sockaddr*>(&address), size) != 0 ||
      listen(listening_, 64) != 0 ||
      getsockname(listening_, reinterpret_cast<sockaddr*>(&address), &size) != 0) {
    throw std::runtime_error("the proxy cannot listen");
  }
  port_ = ntohs(address.sin_port);
  thread_ = std::thread([this] { Run(); });
}

TcpProxy::~TcpProxy() {
  ending_ = true;
  thread_.join();
  CloseAll();
  close(listening_);
}

void TcpProxy::CloseAll() {
  for (const Link& link : links_) {
    Reset(link.client.descriptor);
    Reset(link.server.descriptor);
  }
  links_.clear();
}

void TcpProxy::Accept() {
  const int client = accept4(listening_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
  if (client < 0) return;
  const int server = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_in address = LoopbackAt(target_port_);
  // To this machine: it is there at once, or refused.
  if (connect(server, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
    Reset(client);
    close(server);
    return;
  }
  SendWithoutDelay(client);
  SendWithoutDelay(server);
  links_.push_back({.client = {.descriptor = client}, .server = {.descriptor = server}});
}

bool TcpProxy::Pass(Side* from, Side* to) {
  std::array<char, 65536> buffer{};
  if (!from->ended && to->unsent.size() < kMaxUnsent) {
    const ssize_t got = recv(from->descriptor, buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (got > 0) to->unsent.append(buffer.data(), static_cast<size_t>(got));
    if (got == 0) from->ended = true;
    if (got < 0 && errno != EAGAIN && errno != EINTR) return false;
  }
  if (!to->unsent.empty()) {
    const ssize_t sent =
        send(to->descriptor, to->unsent.data(), to->unsent.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    if (sent > 0) to->unsent.erase(0, static_cast<size_t>(sent));
    if (sent < 0 && errno != EAGAIN && errno != EINTR) return false;
  }
  if (!from->ended || !to->unsent.empty()) return true;
  return shutdown(to->descriptor, SHUT_WR) == 0 && !to->ended;
}

void TcpProxy::Run() {
  while (!ending_) {
    if (cut_.exchange(false)) CloseAll();
    std::vector<pollfd> waits;
    if (!down_) {
      waits.push_back({.fd = listening_, .events = POLLIN, .revents = 0});
      for (const Link& link : links_) {
        for (const auto& [side, other] :
             {std::pair{&link.client, &link.server}, {&link.server, &link.client}}) {
          int events = side->unsent.empty() ? 0 : POLLOUT;
          if (!side->ended && other->unsent.size() < kMaxUnsent) events |= POLLIN;
          waits.push_back(
              {.fd = side->descriptor, .events = static_cast<int16_t>(events), .revents = 0});
        }
      }
    }
    poll(waits.data(), waits.size(), 20);
    if (down_) continue;
    Accept();
    for (auto link = links_.begin(); link != links_.end();) {
      if (Pass(&link->client, &link->server) && Pass(&link->server, &link->client)) {
        ++link;
        continue;
      }
      Reset(link->client.descriptor);
      Reset(link->server.descriptor);
      link = links_.erase(link);
    }
  }
}

}  // namespace rigcal::testing
