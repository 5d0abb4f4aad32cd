// SPDX-License-Identifier: Apache-2.0
#include "server/standby/standby.h"

#include <signal.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <random>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/service/service_notice.h"
#include "common/status/status_macros.h"
#include "server/care/running_server.h"
#include "server/listen/port_file.h"
#include "server/metrics/metrics.h"
#include "server/replica/data_role.h"
#include "server/rpc/replication_client.h"
#include "server/rpc/replication_service.h"
#include "server/standby/follower.h"

namespace rigcal::server {
namespace {

constexpr std::chrono::seconds kFirstAnswer{5};

std::string NewStandbyId() {
  std::random_device device;
  return absl::StrFormat("%08x%08x", device(), device());
}

sigset_t EndSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGTERM, SIGINT, SIGRTMIN}) sigaddset(&signals, signal);
  return signals;
}

// The ports of a server that must not serve, and the files that name them.
struct ClosedPorts {
  std::unique_ptr<StandbyServer> rpc;
  int rpc_port = 0;
  std::unique_ptr<WebServer> web;
};

absl::StatusOr<ClosedPorts> OpenPorts(const StandbyOptions& options, StandbyServerOptions server,
                                      std::function<WaitingNotice()> notice) {
  ClosedPorts ports;
  ports.rpc = std::make_unique<StandbyServer>(std::move(server));
  RIGCAL_ASSIGN_OR_RETURN(ports.rpc_port, ports.rpc->Start());
  WebServerOptions web = options.web;
  web.waiting = std::move(notice);
  RIGCAL_ASSIGN_OR_RETURN(ports.web, WebServer::Open(std::move(web)));
  RIGCAL_RETURN_IF_ERROR(ports.web->Start(ports.rpc_port, {}));
  if (!options.http_port_file.empty()) {
    RIGCAL_RETURN_IF_ERROR(WritePortFile(options.http_port_file, ports.web->port()));
  }
  if (!options.port_file.empty()) {
    RIGCAL_RETURN_IF_ERROR(WritePortFile(options.port_file, ports.rpc_port));
  }
  return ports;
}

std::string SocketAddress(const StandbyOptions& options) {
  return absl::StrCat("unix:",
                      std::filesystem::absolute(options.server.endpoint.socket_file).string());
}

// The role of the folder from now on. A new one follows from its beginning; one with data does once
// it is known that nothing of it would be deleted.
absl::StatusOr<DataRole> PrepareRole(const StandbyOptions& options, const Store& store) {
  RIGCAL_ASSIGN_OR_RETURN(DataRole role, ReadDataRole(options.data_dir));
  if (role.role == RoleOfData::kStandby && role.primary != options.primary) {
    spdlog::info("this standby followed {}, and follows {} now", role.primary, options.primary);
  }
  role.primary = options.primary;
  if (role.standby_id.empty()) role.standby_id = NewStandbyId();
  if (role.role != RoleOfData::kStandby) {
    role.complete = false;
    RIGCAL_ASSIGN_OR_RETURN(const auto sessions, store.ListSessions({}, {.limit = 1}));
    RIGCAL_ASSIGN_OR_RETURN(const auto calibrations, store.ListCalibrations({}, {.limit = 1}));
    if (!sessions.empty() || !calibrations.empty()) return role;
    role.role = RoleOfData::kStandby;
  }
  RIGCAL_RETURN_IF_ERROR(WriteDataRole(options.data_dir, role));
  return role;
}

class Standby {
 public:
  Standby(const StandbyOptions& options, std::unique_ptr<Store> store, DataRole role,
          std::unique_ptr<PrimaryLink> link)
      : options_(options),
        store_(std::move(store)),
        link_(std::move(link)),
        was_promoted_(role.role == RoleOfData::kPromoted),
        reason_(WhyNotToServe({.role = RoleOfData::kStandby, .primary = options.primary})),
        role_(role),
        follower_({.primary = options.primary,
                   .own_address = options.own_name,
                   .data_dir = options.data_dir,
                   .process_id = ProcessId()},
                  std::move(role), store_.get(), link_.get()) {}

  absl::StatusOr<StandbyEnd> Run() {
    // Before it can be promoted, which ends it.
    follower_.Start();
    StandbyServerOptions server = options_.server;
    server.active_server = options_.primary;
    server.reason = reason_;
    server.promote = [this](bool force) { return Promote(force); };
    RIGCAL_ASSIGN_OR_RETURN(const ClosedPorts ports,
                            OpenPorts(options_, std::move(server), [this] { return Notice(); }));
    // It uses this object.
    const absl::Cleanup stop_web = [&] { ports.web->Shutdown(); };
    const absl::Status answer = follower_.WaitForFirstAnswer(kFirstAnswer);
    // An older server refuses to be followed; one that answers was promoted after this one.
    if (was_promoted_ && follower_.State().silence_s < 0) {
      ports.rpc->Shutdown();
      follower_.Shutdown();
      spdlog::warn(
          "this server was promoted, and none that was promoted after it answers at {}{}: it "
          "serves, "
          "and --follow has no effect",
          options_.primary, answer.ok() ? "" : absl::StrCat(" (", answer.message(), ")"));
      return StandbyEnd::kPromoted;
    }
    RIGCAL_RETURN_IF_ERROR(answer);
    const RunningServerNote note(options_.data_dir, SocketAddress(options_));
    spdlog::info(
        "a standby of {}: port {} refuses calls until it is promoted (rigcal-server "
        "promote --data-dir {}); how far behind it is: {}",
        options_.primary, ports.rpc_port, options_.data_dir, ports.web->LocalUrl());
    TellReady(absl::StrCat("a standby of ", options_.primary));
    const int signal = WaitForSignal(EndSignals(), [this] { store_->Health(); });
    ports.rpc->Shutdown();
    follower_.Shutdown();
    if (promoted_) return StandbyEnd::kPromoted;
    TellStopping();
    spdlog::info("stopping on signal {}", signal);
    return StandbyEnd::kStopped;
  }

 private:
  // For browsers and monitoring.
  WaitingNotice Notice() const {
    const FollowerState state = follower_.State();
    std::string message = absl::StrCat(reason_, ". ");
    if (state.silence_s < 0) {
      absl::StrAppend(&message, "It has not heard of it yet");
    } else {
      absl::StrAppendFormat(&message, "It is %d observations behind, and heard of it %.0f s ago",
                            state.behind_count, state.silence_s);
    }
    if (!state.complete) absl::StrAppend(&message, "; it has not had everything of it yet");
    if (!state.problem.empty()) absl::StrAppend(&message, "; nothing is copied: ", state.problem);
    return {
        .message = std::move(message),
        .active_page = "",
        .title = absl::StrCat("Standby of ", options_.primary),
        .metrics = StandbyMetricsText({.primary = options_.primary,
                                       .complete = state.complete,
                                       .behind_count = state.behind_count,
                                       .silence_s = state.silence_s,
                                       .follows = state.silence_s >= 0 && state.problem.empty()})};
  }

  absl::StatusOr<Promotion> Promote(bool force) {
    const std::lock_guard lock(mutex_);
    if (promoted_) return absl::FailedPreconditionError("this server is being promoted already");
    const FollowerState state = follower_.State();
    if (!force && link_->Answers()) {
      return absl::FailedPreconditionError(
          absl::StrCat("the primary ", options_.primary,
                       " answers: two servers must not serve the same data. Stop it, or promote "
                       "with --force: then it is told to stop as soon as it can be reached"));
    }
    if (!force && !state.complete) {
      return absl::FailedPreconditionError(
          absl::StrCat("this standby has never had all data of ", options_.primary,
                       state.problem.empty() ? "" : absl::StrCat(" (", state.problem, ")"),
                       "; promote with --force to go on with what it has"));
    }
    follower_.Shutdown();
    RIGCAL_ASSIGN_OR_RETURN(const uint64_t generation, store_->replica_target()->RaiseGeneration());
    role_.role = RoleOfData::kPromoted;
    role_.complete = state.complete;
    role_.generation = generation;
    RIGCAL_RETURN_IF_ERROR(WriteDataRole(options_.data_dir, role_));
    promoted_ = true;
    spdlog::warn("promoted: this server takes over from {} with generation {}", options_.primary,
                 generation);
    kill(getpid(), SIGRTMIN);
    return Promotion{.generation = generation,
                     .primary = options_.primary,
                     .silence_s = state.silence_s,
                     .missing_count = state.behind_count};
  }

  const StandbyOptions& options_;
  const std::unique_ptr<Store> store_;
  const std::unique_ptr<PrimaryLink> link_;
  const bool was_promoted_;
  const std::string reason_;
  std::mutex mutex_;
  DataRole role_;
  std::atomic<bool> promoted_ = false;
  Follower follower_;
};

}  // namespace

absl::StatusOr<StandbyEnd> RunStandby(const StandbyOptions& options) {
  RIGCAL_ASSIGN_OR_RETURN(auto store, OpenStore(options.data_dir, options.store));
  if (store->replica_target() == nullptr) {
    return absl::InvalidArgumentError(
        "a standby has its database in its data folder: leave out --store");
  }
  RIGCAL_ASSIGN_OR_RETURN(DataRole role, PrepareRole(options, *store));
  RIGCAL_ASSIGN_OR_RETURN(auto link, LinkToPrimary(options.primary));
  Standby standby(options, std::move(store), std::move(role), std::move(link));
  return standby.Run();
}

absl::Status RunRefusing(const StandbyOptions& options) {
  const std::string& reason = options.server.reason;
  const auto notice = [&reason] {
    return WaitingNotice{.message = reason, .active_page = "", .title = "This server was replaced"};
  };
  RIGCAL_ASSIGN_OR_RETURN(const ClosedPorts ports, OpenPorts(options, options.server, notice));
  const RunningServerNote note(options.data_dir, SocketAddress(options));
  spdlog::error("{}; port {} refuses every call", reason, ports.rpc_port);
  TellReady(reason);
  WaitForSignal(EndSignals(), [] {});
  TellStopping();
  ports.web->Shutdown();
  ports.rpc->Shutdown();
  return absl::OkStatus();
}

}  // namespace rigcal::server
