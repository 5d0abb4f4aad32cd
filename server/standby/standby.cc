// SPDX-License-Identifier: Apache-2.0
#include "server/standby/standby.h"

#include <signal.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <random>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/service/service_notice.h"
#include "common/status/status_macros.h"
#include "server/care/running_server.h"
#include "server/listen/port_file.h"
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
        role_(role),
        follower_({.primary = options.primary,
                   .own_address = options.own_name,
                   .data_dir = options.data_dir,
                   .process_id = ProcessId()},
                  std::move(role), store_.get(), link_.get()) {}

  absl::StatusOr<StandbyEnd> Run() {
    follower_.Start();
    RIGCAL_RETURN_IF_ERROR(follower_.WaitForFirstAnswer(kFirstAnswer));
    StandbyServerOptions ports = options_.server;
    ports.active_server = options_.primary;
    ports.reason = WhyNotToServe({.role = RoleOfData::kStandby, .primary = options_.primary});
    ports.promote = [this](bool force) { return Promote(force); };
    const std::filesystem::path socket_file = ports.endpoint.socket_file;
    StandbyServer server(std::move(ports));
    RIGCAL_ASSIGN_OR_RETURN(const int port, server.Start());
    if (!options_.port_file.empty()) {
      RIGCAL_RETURN_IF_ERROR(WritePortFile(options_.port_file, port));
    }
    const RunningServerNote note(
        options_.data_dir, absl::StrCat("unix:", std::filesystem::absolute(socket_file).string()));
    spdlog::info(
        "a standby of {}: port {} refuses calls until it is promoted (rigcal-server "
        "promote --data-dir {})",
        options_.primary, port, options_.data_dir);
    TellReady(absl::StrCat("a standby of ", options_.primary));
    const int signal = WaitForSignal(EndSignals(), [this] { store_->Health(); });
    server.Shutdown();
    follower_.Shutdown();
    if (promoted_) return StandbyEnd::kPromoted;
    TellStopping();
    spdlog::info("stopping on signal {}", signal);
    return StandbyEnd::kStopped;
  }

 private:
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

absl::Status RunRefusing(StandbyServerOptions options, const std::string& data_dir,
                         const std::string& port_file) {
  const std::string reason = options.reason;
  const std::string socket_file = std::filesystem::absolute(options.endpoint.socket_file).string();
  StandbyServer server(std::move(options));
  RIGCAL_ASSIGN_OR_RETURN(const int port, server.Start());
  if (!port_file.empty()) RIGCAL_RETURN_IF_ERROR(WritePortFile(port_file, port));
  const RunningServerNote note(data_dir, absl::StrCat("unix:", socket_file));
  spdlog::error("{}; port {} refuses every call", reason, port);
  TellReady(reason);
  WaitForSignal(EndSignals(), [] {});
  TellStopping();
  server.Shutdown();
  return absl::OkStatus();
}

}  // namespace rigcal::server
