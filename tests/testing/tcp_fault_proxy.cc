// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/tcp_fault_proxy.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <deque>
#include <optional>
#include <system_error>

namespace rigcal::testing {
namespace {

using std::chrono::milliseconds;
using FaultClock = std::chrono::steady_clock;

constexpr size_t kSegmentBytes = 1448;
// On the way in one direction of a connection, about; more stays with the sender.
constexpr size_t kMostOnTheWay = size_t{256} << 10;

sockaddr_in OnLoopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

void Require(bool holds, const char* what) {
  if (!holds) throw std::system_error(errno, std::generic_category(), what);
}

// Closed so that the other side gets a reset.
void Reset(int descriptor) {
  if (descriptor < 0) return;
  const linger at_once{.l_onoff = 1, .l_linger = 0};
  setsockopt(descriptor, SOL_SOCKET, SO_LINGER, &at_once, sizeof(at_once));
  close(descriptor);
}

}  // namespace

// Two sockets, and what is on its way between them.
class TcpFaultProxy::Connection {
 public:
  Connection(int client, int server_port)
      : flows_{Flow{.from = client}, Flow{.to = client}},
        server_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {
    const sockaddr_in address = OnLoopback(server_port);
    const int done = connect(server_, reinterpret_cast<const sockaddr*>(&address), sizeof(address));
    if (done != 0 && errno != EINPROGRESS) is_broken_ = true;
    flows_[0].to = flows_[1].from = server_;
    const int at_once = 1;
    for (const int descriptor : {client, server_}) {
      setsockopt(descriptor, IPPROTO_TCP, TCP_NODELAY, &at_once, sizeof(at_once));
    }
  }
  ~Connection() {
    if (has_ended()) {
      close(flows_[0].from);
      close(server_);
      return;
    }
    Reset(flows_[0].from);
    Reset(server_);
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  // Both directions are closed in order.
  bool has_ended() const { return flows_[0].end_passed && flows_[1].end_passed; }
  bool is_over() const { return is_broken_ || has_ended(); }

  // What poll is to wait for, for both sockets.
  std::array<pollfd, 2> Wanted(const State& state, FaultClock::time_point now) const {
    std::array<pollfd, 2> wanted{pollfd{.fd = flows_[0].from, .events = 0, .revents = 0},
                                 pollfd{.fd = server_, .events = 0, .revents = 0}};
    for (size_t side = 0; side < 2; ++side) {
      if (WantsMore(flows_[side])) wanted[side].events |= POLLIN;
      const Flow& incoming = flows_[1 - side];
      const bool can_arrive = !state.links[1 - side].is_black_hole && !incoming.on_the_way.empty();
      if (can_arrive && incoming.on_the_way.front().due <= now) wanted[side].events |= POLLOUT;
      if (wanted[side].events == 0) wanted[side].fd = -1;  // else poll reports its end for ever
    }
    return wanted;
  }
  // When the next bytes arrive; none: not before something else happens.
  std::optional<FaultClock::time_point> NextDue(const State& state) const {
    std::optional<FaultClock::time_point> next;
    for (size_t way = 0; way < 2; ++way) {
      if (state.links[way].is_black_hole || flows_[way].on_the_way.empty()) continue;
      const auto due = flows_[way].on_the_way.front().due;
      if (!next || due < *next) next = due;
    }
    return next;
  }
  // Takes what has been sent. `due` says when so many bytes arrive.
  template <typename Due>
  void Take(size_t way, size_t most, Due due) {
    Flow& flow = flows_[way];
    std::array<char, size_t{64} << 10> buffer;
    while (WantsMore(flow)) {
      const ssize_t got = recv(flow.from, buffer.data(), std::min(most, buffer.size()), 0);
      if (got < 0 && (errno == EAGAIN || errno == EINTR)) return;
      if (got <= 0) {
        flow.end_taken = true;
        flow.is_reset = got < 0;
        return;
      }
      const auto size = static_cast<size_t>(got);
      flow.last_due = std::max(flow.last_due, due(size));
      flow.on_the_way.push_back({flow.last_due, {buffer.data(), size}});
      flow.byte_count += size;
    }
  }
  // Delivers what is due; returns how many bytes.
  size_t Deliver(size_t way, FaultClock::time_point now) {
    Flow& flow = flows_[way];
    size_t delivered = 0;
    while (!flow.on_the_way.empty() && flow.on_the_way.front().due <= now) {
      Piece& piece = flow.on_the_way.front();
      const ssize_t sent = send(flow.to, piece.bytes.data() + piece.sent,
                                piece.bytes.size() - piece.sent, MSG_NOSIGNAL | MSG_DONTWAIT);
      if (sent < 0 && (errno == EAGAIN || errno == EINTR)) return delivered;
      if (sent < 0) {  // the receiver has gone, and its end is in the other direction
        flow.on_the_way.clear();
        flow.byte_count = 0;
        flow.end_taken = true;
        break;
      }
      delivered += static_cast<size_t>(sent);
      piece.sent += static_cast<size_t>(sent);
      flow.byte_count -= static_cast<size_t>(sent);
      if (piece.sent == piece.bytes.size()) flow.on_the_way.pop_front();
    }
    if (flow.end_taken && flow.on_the_way.empty() && !flow.end_passed) {
      if (flow.is_reset) is_broken_ = true;
      shutdown(flow.to, SHUT_WR);
      flow.end_passed = true;
    }
    return delivered;
  }

 private:
  struct Piece {
    FaultClock::time_point due;
    std::string bytes;
    size_t sent = 0;
  };
  struct Flow {
    int from = -1;
    int to = -1;
    std::deque<Piece> on_the_way = {};
    size_t byte_count = 0;  // of on_the_way
    FaultClock::time_point last_due = {};
    bool end_taken = false;  // the sender has closed its side ...
    bool is_reset = false;   // ... by a reset
    bool end_passed = false;
  };

  static bool WantsMore(const Flow& flow) {
    return !flow.end_taken && flow.byte_count < kMostOnTheWay;
  }

  std::array<Flow, 2> flows_;  // by Direction
  int server_;
  bool is_broken_ = false;
};

TcpFaultProxy::TcpFaultProxy(int server_port)
    : listener_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)),
      wake_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      server_port_(server_port) {
  Require(listener_ >= 0 && wake_ >= 0, "TcpFaultProxy: no descriptors");
  sockaddr_in address = OnLoopback(0);
  Require(bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0 &&
              listen(listener_, SOMAXCONN) == 0,
          "TcpFaultProxy: cannot listen");
  socklen_t size = sizeof(address);
  Require(getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size) == 0,
          "TcpFaultProxy: no port");
  port_ = ntohs(address.sin_port);
  thread_ = std::thread([this] { Run(); });
}

TcpFaultProxy::~TcpFaultProxy() {
  Change([](State& state) { state = {.links = {}, .cut = true, .stop = true}; });
  thread_.join();
  close(listener_);
  close(wake_);
}

void TcpFaultProxy::Change(const std::function<void(State&)>& edit) {
  std::unique_lock lock(mutex_);
  edit(state_);
  const uint64_t change = ++change_count_;
  const uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = write(wake_, &one, sizeof(one));
  change_followed_.wait(lock, [&] { return followed_count_ >= change; });
}

void TcpFaultProxy::Set(Direction direction, const Link& link) {
  Change([&](State& state) { state.links[static_cast<size_t>(direction)] = link; });
}

void TcpFaultProxy::Set(const Link& link) {
  Change([&](State& state) { state.links = {link, link}; });
}

void TcpFaultProxy::Cut() {
  Change([](State& state) { state.cut = true; });
}

void TcpFaultProxy::Restore() {
  Change([](State& state) { state = {}; });
}

uint64_t TcpFaultProxy::attempt_count() const {
  const std::lock_guard lock(mutex_);
  return attempt_count_;
}

uint64_t TcpFaultProxy::byte_count(Direction direction) const {
  const std::lock_guard lock(mutex_);
  return byte_counts_[static_cast<size_t>(direction)];
}

void TcpFaultProxy::Run() {
  while (true) {
    State state;
    {
      const std::lock_guard lock(mutex_);
      state = state_;
      if (state.cut) connections_.clear();
      followed_count_ = change_count_;
    }
    change_followed_.notify_all();
    if (state.stop) return;
    Accept(state.cut);
    Move(state);
    Wait(state);
  }
}

void TcpFaultProxy::Accept(bool cut) {
  while (true) {
    const int client = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (client < 0) return;
    {
      const std::lock_guard lock(mutex_);
      ++attempt_count_;
    }
    if (cut) {
      Reset(client);
    } else {
      connections_.push_back(std::make_unique<Connection>(client, server_port_));
    }
  }
}

void TcpFaultProxy::Move(const State& state) {
  const Clock::time_point now = Clock::now();
  std::array<size_t, 2> delivered{};
  for (const auto& connection : connections_) {
    for (size_t way = 0; way < 2; ++way) {
      const Link& link = state.links[way];
      const auto due = [&](size_t size) {
        Clock::time_point leaves = now;
        if (link.bytes_per_s > 0) {
          const std::chrono::duration<double> sending(static_cast<double>(size) /
                                                      static_cast<double>(link.bytes_per_s));
          leaves =
              std::max(link_free_[way], now) + std::chrono::duration_cast<Clock::duration>(sending);
          link_free_[way] = leaves;
        }
        const bool is_lost = std::bernoulli_distribution(link.loss)(random_);
        return leaves + link.latency + (is_lost ? link.repetition : milliseconds(0));
      };
      connection->Take(way, link.loss > 0 ? kSegmentBytes : SIZE_MAX, due);
      if (!link.is_black_hole) delivered[way] += connection->Deliver(way, now);
    }
  }
  std::erase_if(connections_, [](const auto& connection) { return connection->is_over(); });
  const std::lock_guard lock(mutex_);
  for (size_t way = 0; way < 2; ++way) byte_counts_[way] += delivered[way];
}

void TcpFaultProxy::Wait(const State& state) {
  const Clock::time_point now = Clock::now();
  std::vector<pollfd> wanted{{.fd = wake_, .events = POLLIN, .revents = 0},
                             {.fd = listener_, .events = POLLIN, .revents = 0}};
  std::optional<Clock::time_point> next;
  for (const auto& connection : connections_) {
    const auto of_it = connection->Wanted(state, now);
    wanted.insert(wanted.end(), of_it.begin(), of_it.end());
    const auto due = connection->NextDue(state);
    // What is due already waits for its receiver, not for a time.
    if (due && *due > now && (!next || *due < *next)) next = due;
  }
  int timeout_ms = -1;
  if (next) timeout_ms = static_cast<int>(std::chrono::ceil<milliseconds>(*next - now).count());
  poll(wanted.data(), wanted.size(), timeout_ms);
  uint64_t woken = 0;
  [[maybe_unused]] const ssize_t got = read(wake_, &woken, sizeof(woken));
}

}  // namespace rigcal::testing
