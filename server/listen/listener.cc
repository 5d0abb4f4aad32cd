// SPDX-License-Identifier: Apache-2.0
#include "server/listen/listener.h"

#include <fcntl.h>
#include <linux/tcp.h>
#include <malloc.h>
#include <netinet/in.h>
#include <spdlog/spdlog.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/listen/listen_socket.h"

namespace rigcal::server {
namespace {

constexpr char kTlsHandshake = 0x16;
constexpr char kHttp2Preface = 'P';  // "PRI * HTTP/2.0"
constexpr char kProbe = 0x01;
constexpr int kAcceptsPerRound = 64;
constexpr std::chrono::milliseconds kPause{100};
// malloc keeps what was freed; so often it is given back to the system, if memory has grown by
// this.
constexpr std::chrono::seconds kGiveBackInterval{10};
constexpr uint64_t kGrownBytes = 32u << 20;
// By which PeerConduct knows clients of this machine without a certificate.
constexpr char kPlainClients[] = "plain";
constexpr std::chrono::seconds kSameLack{10};  // so long after the last, it is one in the log

bool IsLackOfDescriptors(int error) {
  return error == EMFILE || error == ENFILE || error == ENOBUFS || error == ENOMEM;
}

// Resident in this process; 0: not known.
uint64_t ResidentBytes() {
  std::ifstream file("/proc/self/statm");
  uint64_t total = 0;
  uint64_t resident = 0;
  if (!(file >> total >> resident)) return 0;
  return resident * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

// The user at the other end of a socket file is the server's own, or root.
bool IsOwnUser(int descriptor) {
  ucred other{};
  socklen_t size = sizeof(other);
  return getsockopt(descriptor, SOL_SOCKET, SO_PEERCRED, &other, &size) == 0 &&
         (other.uid == geteuid() || other.uid == 0);
}

}  // namespace

Listener::Listener(ListenerOptions options, AuditLog* audit, PeerConduct* conduct)
    : options_(std::move(options)),
      audit_(*audit),
      conduct_(conduct),
      connections_(options_.limits),
      guard_(options_.floods),
      stall_(options_.readers) {}

Listener::~Listener() {
  Stop();
  for (const int descriptor : {epoll_, wake_, reserve_, internet_, file_}) {
    if (descriptor >= 0) close(descriptor);
  }
}

absl::StatusOr<int> Listener::Bind() {
  if (!options_.address.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(internet_, ListenOn(options_.address));
    port_ = PortOf(internet_);
  }
  if (!options_.socket_file.empty()) {
    const absl::StatusOr<int> file = ListenOnFile(options_.socket_file);
    file_ = file.ok() ? *file : -1;
    if (!file.ok()) spdlog::warn("{}; clients use the port", std::string(file.status().message()));
  }
  return port_;
}

void Listener::Start(Take take) {
  take_ = std::move(take);
  epoll_ = epoll_create1(EPOLL_CLOEXEC);
  wake_ = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  reserve_ = open("/dev/null", O_RDONLY | O_CLOEXEC);
  for (const int descriptor : {wake_, internet_, file_}) {
    if (descriptor >= 0) Watch(descriptor, EPOLLIN, EPOLL_CTL_ADD);
  }
  accepting_ = std::thread([this] { Run(); });
  if (port_ != 0) probing_ = std::thread([this] { RunProbes(); });
}

void Listener::Stop() {
  if (stopping_.exchange(true)) return;
  {
    std::lock_guard lock(mutex_);
    stop_changed_.notify_all();
  }
  if (wake_ >= 0) {
    const uint64_t one = 1;
    [[maybe_unused]] const ssize_t written = write(wake_, &one, sizeof(one));
  }
  if (accepting_.joinable()) accepting_.join();
  if (probing_.joinable()) probing_.join();
  while (!silent_.empty()) DropSilent(silent_.begin());
  if (file_ >= 0) unlink(options_.socket_file.c_str());
}

void Listener::Watch(int descriptor, uint32_t events, int operation) const {
  epoll_event event{};
  event.events = events;
  event.data.fd = descriptor;
  epoll_ctl(epoll_, operation, descriptor, &event);
}

void Listener::Run() {
  std::array<epoll_event, 256> events{};
  while (!stopping_) {
    Clock::time_point wake_at = Clock::now() + std::chrono::seconds(1);
    if (!silent_.empty()) wake_at = std::min(wake_at, silent_.front().deadline);
    if (paused_until_) wake_at = std::min(wake_at, *paused_until_);
    if (!taken_.empty()) wake_at = std::min(wake_at, next_look_);
    if (!give_back_.empty()) wake_at = std::min(wake_at, give_back_.front());
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(wake_at - Clock::now()).count();
    const int count = epoll_wait(epoll_, events.data(), static_cast<int>(events.size()),
                                 static_cast<int>(std::max<int64_t>(left + 1, 0)));
    if (stopping_) return;
    for (int i = 0; i < count; ++i) {
      const int descriptor = events.at(static_cast<size_t>(i)).data.fd;
      if (descriptor == wake_) continue;
      if (descriptor == internet_ || descriptor == file_) {
        AcceptAll(descriptor);
      } else if (const auto silent = silent_by_descriptor_.find(descriptor);
                 silent != silent_by_descriptor_.end()) {
        Decide(silent->second);
      } else if (const auto taken = taken_.find(descriptor); taken != taken_.end()) {
        const bool tls = taken->second == Kind::kTls;
        taken_.erase(taken);
        const std::string from = connections_.AddressOf(descriptor);
        if (!connections_.Remove(descriptor) && tls) {
          audit_.Write("connection_without_call", from,
                       {{"reason",
                         "it ended in the TLS handshake or right after it: no "
                         "certificate, one that is refused, or none that is wanted"}});
        }
      }
    }
    LookForFloods();
    while (!silent_.empty() && silent_.front().deadline <= Clock::now()) {
      const Silent& silent = silent_.front();
      audit_.Write("connection_refused", AddressText(silent.from),
                   {{"reason", "it sent nothing in time"}});
      connections_.CountRefused();
      DropSilent(silent_.begin());
    }
    if (paused_until_ && *paused_until_ <= Clock::now()) {
      paused_until_.reset();
      for (const int descriptor : {internet_, file_}) {
        if (descriptor >= 0) Watch(descriptor, EPOLLIN, EPOLL_CTL_MOD);
      }
    }
  }
}

void Listener::LookForFloods() {
  const Clock::time_point now = Clock::now();
  if (now < next_look_) return;
  const uint64_t resident_bytes = ResidentBytes();
  const uint64_t unclaimed_bytes = UnclaimedBytes(resident_bytes);
  const std::vector<ConnectionTraffic> traffic = connections_.Traffic();
  if (stall_.Look(traffic, now) && options_.on_stall) options_.on_stall();
  for (const FloodGuard::Cut& cut : guard_.Look(traffic, unclaimed_bytes, now)) {
    const std::optional<Connections::Flooding> flooding = connections_.CutFlood(cut.id, cut.why);
    if (!flooding) continue;
    const std::string peer = flooding->peer ? Describe(*flooding->peer) : "a client";
    const bool plain = flooding->is_plain;
    std::string why = cut.why;
    if (conduct_ != nullptr && (flooding->peer || plain)) {
      const auto ban =
          conduct_->Ban(flooding->peer ? flooding->peer->uri : kPlainClients, why, now);
      absl::StrAppend(&why,
                      plain ? "; clients of this PC that have no certificate are kept out of "
                              "the port for "
                            : "; it is kept out for ",
                      ban.count(), " s");
    }
    if (flooding->peer) {
      connections_.CutIf([&](const Peer& other) { return other.uri == flooding->peer->uri; });
    }
    spdlog::error("the connection of {} from {} floods the server and is cut: {}", peer,
                  flooding->address, why);
    audit_.Write("connection_cut", flooding->peer ? peer : flooding->address,
                 {{"address", flooding->address}, {"reason", why}});
    // gRPC frees what it has of a connection soon after its end.
    give_back_ = {now + std::chrono::milliseconds(300), now + std::chrono::seconds(2)};
  }
  next_look_ = now + (guard_.has_suspect() ? options_.suspect_interval : options_.flood_interval);
  GiveMemoryBack(resident_bytes, now);
}

uint64_t Listener::UnclaimedBytes(uint64_t resident_bytes) {
  // malloc keeps what was freed until it is given back.
  if (options_.waiting_bytes) {
    most_waiting_bytes_ = std::max(most_waiting_bytes_, options_.waiting_bytes());
  }
  return resident_bytes - std::min(resident_bytes, most_waiting_bytes_);
}

void Listener::GiveMemoryBack(uint64_t resident_bytes, Clock::time_point now) {
  const bool after_flood = !give_back_.empty() && give_back_.front() <= now;
  if (after_flood) give_back_.pop_front();
  const bool has_grown = now >= next_give_back_ && resident_bytes > kept_bytes_ + kGrownBytes;
  if (!after_flood && !has_grown) return;
  malloc_trim(0);
  kept_bytes_ = ResidentBytes();
  most_waiting_bytes_ = 0;
  next_give_back_ = now + kGiveBackInterval;
}

void Listener::AcceptAll(int listening) {
  for (int i = 0; i < kAcceptsPerRound && !paused_until_; ++i) {
    sockaddr_storage from{};
    const absl::StatusOr<int> descriptor = AcceptOne(listening, &from);
    if (!descriptor.ok()) return;
    if (*descriptor >= 0) Welcome(*descriptor, from);
  }
}

absl::StatusOr<int> Listener::AcceptOne(int listening, sockaddr_storage* from) {
  socklen_t size = sizeof(*from);
  const auto accept_next = [&] {
    size = sizeof(*from);
    return accept4(listening, reinterpret_cast<sockaddr*>(from), &size,
                   SOCK_NONBLOCK | SOCK_CLOEXEC);
  };
  const int descriptor = accept_next();
  if (descriptor >= 0) return descriptor;
  const int error = errno;
  // A client that has gone again; the next one waits already.
  if (error == ECONNABORTED || error == EINTR || error == EPROTO) return -1;
  if (!IsLackOfDescriptors(error)) return absl::UnavailableError("nobody waits");
  // With the reserve, this client gets an end instead of waiting for ever; then a pause, in which
  // others give descriptors back.
  connections_.CountRefused();
  if (!silent_.empty()) {
    DropSilent(silent_.begin());
  } else if (reserve_ >= 0) {
    close(std::exchange(reserve_, -1));
    if (const int refused = accept_next(); refused >= 0) close(refused);
    reserve_ = open("/dev/null", O_RDONLY | O_CLOEXEC);
    PauseAccepting();
  } else {
    reserve_ = open("/dev/null", O_RDONLY | O_CLOEXEC);
    PauseAccepting();
  }
  return -1;
}

void Listener::PauseAccepting() {
  const Clock::time_point now = Clock::now();
  if (!last_lack_ || now - *last_lack_ > kSameLack) {
    spdlog::error(
        "no descriptors are left for connections; clients are refused until some are free");
  }
  last_lack_ = now;
  paused_until_ = now + kPause;
  for (const int descriptor : {internet_, file_}) {
    if (descriptor >= 0) Watch(descriptor, 0, EPOLL_CTL_MOD);
  }
}

void Listener::Refuse(int descriptor, const sockaddr_storage& from, const std::string& why) {
  audit_.Write("connection_refused", AddressText(from), {{"reason", why}});
  connections_.CountRefused();
  if (descriptor >= 0) close(descriptor);
}

bool Listener::MakeRoom(const sockaddr_storage& from) {
  if (silent_.size() >= options_.max_silent) DropSilent(silent_.begin());
  while (true) {
    const Connections::Verdict verdict = connections_.Check(from);
    if (verdict == Connections::Verdict::kWelcome) return true;
    const bool all = verdict == Connections::Verdict::kTooManyInAll;
    const auto silent = std::ranges::find_if(silent_, [&](const Silent& candidate) {
      return all || AddressGroup(candidate.from) == AddressGroup(from);
    });
    if (silent != silent_.end()) {
      DropSilent(silent);
      continue;
    }
    if (const std::optional<int> idle = connections_.FindIdle(from, verdict, Clock::now())) {
      audit_.Write("connection_cut", connections_.AddressOf(*idle),
                   {{"reason", "it was idle, and another client needed its place"}});
      taken_.erase(*idle);
      // gRPC holds the connection as well, so that closing it would leave it with epoll.
      Watch(*idle, 0, EPOLL_CTL_DEL);
      connections_.Cut(*idle);
      connections_.Remove(*idle);
      continue;
    }
    if (connections_.NoteRefusal(verdict, from)) {
      spdlog::warn(
          "connections from {} are refused: {} are open, which is the limit; raise limits.{} on "
          "the server",
          AddressGroup(from), all ? options_.limits.total : options_.limits.per_address,
          all ? "max_connections" : "max_connections_per_address");
    }
    return false;
  }
}

void Listener::Welcome(int descriptor, const sockaddr_storage& from) {
  if (!MakeRoom(from)) return Refuse(descriptor, from, "too many connections");
  if (from.ss_family == AF_UNIX) {
    if (!IsOwnUser(descriptor)) {
      return Refuse(descriptor, from, "the socket file is for the server's own user");
    }
    connections_.Add(descriptor, from);
    return HandOver(Kind::kPlain, descriptor, /*is_watched=*/false);
  }
  const int on = 1;
  setsockopt(descriptor, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
  connections_.Add(descriptor, from);
  silent_.push_back({descriptor, from, Clock::now() + options_.first_byte_timeout});
  silent_by_descriptor_[descriptor] = std::prev(silent_.end());
  Watch(descriptor, EPOLLIN | EPOLLRDHUP, EPOLL_CTL_ADD);
}

void Listener::DropSilent(SilentList::iterator silent) {
  connections_.Remove(silent->descriptor);
  silent_by_descriptor_.erase(silent->descriptor);
  silent_.erase(silent);
}

void Listener::Decide(SilentList::iterator silent) {
  const int descriptor = silent->descriptor;
  const sockaddr_storage from = silent->from;
  char first = 0;
  const ssize_t got = recv(descriptor, &first, 1, MSG_PEEK | MSG_DONTWAIT);
  if (got < 0 && (errno == EAGAIN || errno == EINTR)) return;
  const bool plain = options_.plain_loopback && IsLoopback(from);
  std::string why;
  if (got == 1 && first == kTlsHandshake && options_.tls) {
    silent_by_descriptor_.erase(descriptor);
    silent_.erase(silent);
    return HandOver(Kind::kTls, descriptor, /*is_watched=*/true);
  }
  if (got == 1 && first == kHttp2Preface && plain && conduct_ != nullptr) {
    if (const auto ban = conduct_->FindBan(kPlainClients, Clock::now())) {
      DropSilent(silent);
      return Refuse(-1, from,
                    absl::StrCat("clients without a certificate are kept out for another ",
                                 ban->left.count(), " s, because one flooded the server"));
    }
  }
  if (got == 1 && first == kHttp2Preface && plain) {
    silent_by_descriptor_.erase(descriptor);
    silent_.erase(silent);
    return HandOver(Kind::kPlain, descriptor, /*is_watched=*/true);
  }
  const bool probe = got == 1 && first == kProbe;
  DropSilent(silent);
  if (got <= 0 || probe) return;
  Refuse(-1, from,
         first == kTlsHandshake ? "it begins with TLS, and this port has no certificates"
         : plain                ? "it is not HTTP/2"
                                : "it is not TLS");
}

void Listener::HandOver(Kind kind, int descriptor, bool is_watched) {
  const int copy = fcntl(descriptor, F_DUPFD_CLOEXEC, 0);
  if (copy < 0) {
    connections_.Remove(descriptor);
    connections_.CountRefused();
    return PauseAccepting();
  }
  taken_[descriptor] = kind;
  if (kind == Kind::kPlain) connections_.SetPlain(descriptor);
  // Only its end is of interest from here on.
  Watch(descriptor, EPOLLRDHUP | EPOLLET, is_watched ? EPOLL_CTL_MOD : EPOLL_CTL_ADD);
  take_(kind, copy);
}

bool Listener::Probe() const {
  if (internet_ < 0) return true;
  sockaddr_storage address{};
  socklen_t size = sizeof(address);
  getsockname(internet_, reinterpret_cast<sockaddr*>(&address), &size);
  const int descriptor = socket(address.ss_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
  // Without a descriptor nothing is known of the accepting thread.
  if (descriptor < 0) return true;
  timeval limit{};
  limit.tv_sec = options_.probe_timeout.count() / 1000;
  limit.tv_usec = (options_.probe_timeout.count() % 1000) * 1000;
  setsockopt(descriptor, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof(limit));
  setsockopt(descriptor, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof(limit));
  // A wildcard address as a destination is this machine.
  bool answered = false;
  if (connect(descriptor, reinterpret_cast<const sockaddr*>(&address), size) == 0) {
    send(descriptor, &kProbe, 1, MSG_NOSIGNAL);
    char byte = 0;
    const ssize_t got = recv(descriptor, &byte, 1, 0);
    // The other side has closed it, which takes a thread that accepts.
    answered = got == 0 || (got < 0 && errno == ECONNRESET);
  }
  close(descriptor);
  return answered;
}

void Listener::RunProbes() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    stop_changed_.wait_for(lock, options_.probe_interval, [this] { return stopping_.load(); });
    if (stopping_) return;
    lock.unlock();
    const bool answered = Probe();
    lock.lock();
    if (answered) {
      if (failed_probes_.exchange(0) >= 2) spdlog::info("the port accepts connections again");
    } else if (!stopping_ && ++failed_probes_ == 2) {
      spdlog::error("the own port {} accepts no connections; restart the server if this lasts",
                    port_);
    }
  }
}

}  // namespace rigcal::server
