// SPDX-License-Identifier: Apache-2.0
#include "server/standby/follower.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/status/guarded.h"
#include "common/status/status_macros.h"
#include "server/standby/divergence.h"

namespace rigcal::server {
namespace {

constexpr size_t kPositionsAtOnce = 20'000;
constexpr std::chrono::seconds kLagInterval{10};
constexpr double kWorthTellingS = 5;

std::set<std::string> IdsOf(const std::vector<ReplicaRecord>& records) {
  std::set<std::string> ids;
  for (const ReplicaRecord& record : records) ids.insert(record.id);
  return ids;
}

std::map<std::string, uint32_t> MarksOf(const std::vector<ReplicaRecord>& records) {
  std::map<std::string, uint32_t> marks;
  for (const ReplicaRecord& record : records) marks[record.id] = record.mark;
  return marks;
}

std::string ContentOf(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace

Follower::Follower(FollowerOptions options, DataRole role, Store* store, PrimaryLink* link)
    : options_(std::move(options)),
      store_(*store),
      own_(*store->replica_source()),
      target_(*store->replica_target()),
      link_(*link),
      role_(std::move(role)) {
  state_.complete = role_.complete;
  // What an empty store was made with says nothing.
  if (role_.role != RoleOfData::kStandby || role_.complete) server_id_ = store_.server_id();
}

Follower::~Follower() { Shutdown(); }

void Follower::Start() {
  thread_ = std::thread([this] { Run(); });
}

void Follower::Shutdown() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    changed_.notify_all();
  }
  link_.Cancel();
  if (thread_.joinable()) thread_.join();
}

FollowerState Follower::State() const {
  const std::lock_guard lock(mutex_);
  FollowerState state = state_;
  if (heard_ != Clock::time_point()) {
    state.silence_s = std::chrono::duration<double>(Clock::now() - heard_).count();
  }
  return state;
}

absl::Status Follower::WaitForFirstAnswer(std::chrono::milliseconds limit) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, limit, [&] { return answered_ || !refused_.ok() || stopping_; });
  return refused_;
}

void Follower::Run() {
  while (true) {
    absl::Status status = Guarded("following the primary", [&] { return Round(); });
    Tell(status);
    std::unique_lock lock(mutex_);
    if (!refused_.ok()) return;
    changed_.wait_for(lock, status.ok() ? options_.pause : options_.retry,
                      [&] { return stopping_; });
    if (stopping_) return;
  }
}

void Follower::Tell(const absl::Status& status) {
  const std::string problem(status.message());
  std::string before;
  FollowerState state;
  {
    const std::lock_guard lock(mutex_);
    if (stopping_) return;
    before = std::exchange(state_.problem, problem);
    state = state_;
  }
  if (problem != before) {
    if (problem.empty()) {
      spdlog::info("standby of {}: follows it again", options_.primary);
    } else if (absl::IsUnavailable(status)) {
      spdlog::warn("standby of {}: it does not answer: {}", options_.primary, problem);
    } else {
      spdlog::error("standby of {}: nothing is copied: {}", options_.primary, problem);
    }
  }
  const Clock::time_point now = Clock::now();
  if (now - lag_told_ < kLagInterval) return;
  const double silence = State().silence_s;
  if (state.behind_count == 0 && silence < kWorthTellingS) return;
  lag_told_ = now;
  spdlog::info("standby of {}: {} observations behind, heard of it {:.1f} s ago", options_.primary,
               state.behind_count, silence);
}

absl::StatusOr<ChangesAnswer> Follower::Ask() {
  ChangesQuestion question{.standby_id = role_.standby_id,
                           .process_id = options_.process_id,
                           .address = options_.own_address,
                           .server_id = server_id_,
                           .generation = 0,
                           .schema_version = store_.Health().schema_version,
                           .position = position_,
                           .run_id = run_id_,
                           .wait_ms = static_cast<uint32_t>(options_.wait.count()),
                           .durable = {}};
  RIGCAL_ASSIGN_OR_RETURN(const uint64_t generation, own_.Generation());
  question.generation = server_id_.empty() ? 0 : generation;
  const size_t count = std::min(durable_.size(), kPositionsAtOnce);
  question.durable.assign(durable_.end() - static_cast<std::ptrdiff_t>(count), durable_.end());
  if (count < durable_.size()) question.wait_ms = 0;
  RIGCAL_ASSIGN_OR_RETURN(ChangesAnswer answer, link_.ListChanges(question));
  if (role_.role == RoleOfData::kStandby) server_id_ = answer.server_id;
  durable_.resize(durable_.size() - count);
  const std::lock_guard lock(mutex_);
  heard_ = Clock::now();
  state_.behind_count = answer.behind_count;
  return answer;
}

absl::Status Follower::Round() {
  const absl::StatusOr<ChangesAnswer> asked = Ask();
  if (absl::IsFailedPrecondition(asked.status()) && !role_.complete) {
    // It cannot follow there, and says so at its start; with data of its own it must not serve that
    // meanwhile either.
    const std::lock_guard lock(mutex_);
    refused_ = asked.status();
    changed_.notify_all();
  }
  if (!asked.ok()) return asked.status();
  const ChangesAnswer& answer = *asked;
  if (answer.all) {
    const absl::Status own = CheckOwnData(answer);
    const std::lock_guard lock(mutex_);
    if (absl::IsFailedPrecondition(own)) refused_ = own;
    if (!own.ok()) {
      changed_.notify_all();
      return own;
    }
  }
  RIGCAL_RETURN_IF_ERROR(Take(answer));
  const bool first = !role_.complete;
  if (first) {
    role_.complete = true;
    role_.role = RoleOfData::kStandby;
    RIGCAL_RETURN_IF_ERROR(WriteDataRole(options_.data_dir, role_));
    spdlog::info("standby of {}: has everything of it ({} sessions, {} calibrations)",
                 options_.primary, answer.sessions.size(), answer.calibrations.size());
  }
  position_ = answer.position;
  run_id_ = answer.run_id;
  const std::lock_guard lock(mutex_);
  answered_ = true;
  state_.complete = true;
  ++state_.rounds;
  changed_.notify_all();
  return absl::OkStatus();
}

absl::Status Follower::CheckOwnData(const ChangesAnswer& answer) {
  RIGCAL_ASSIGN_OR_RETURN(ReplicaListing own, own_.ListReplica());
  if (own.sessions.empty() && own.calibrations.empty()) return absl::OkStatus();
  ReplicaListing primary{
      .sessions = answer.sessions, .calibrations = answer.calibrations, .deleted_sessions = {}};
  if (role_.role == RoleOfData::kStandby) {
    // What the primary has deleted is deleted here too; what it has lost is not.
    const std::set<std::string> there = IdsOf(answer.sessions);
    std::erase_if(own.sessions, [&](const ReplicaRecord& one) { return !there.contains(one.id); });
    own.calibrations.clear();
  } else {
    if (answer.server_id != store_.server_id()) {
      return absl::FailedPreconditionError(
          absl::StrCat(options_.data_dir.string(), " has the data of another server (",
                       store_.server_id(), "), not of ", options_.primary, " (", answer.server_id,
                       "): start the standby with a new data folder. Nothing has been changed"));
    }
    RIGCAL_RETURN_IF_ERROR(
        link_
            .ReadRecord(
                ReplicaKind::kShared, "", {},
                [&](const std::vector<ReplicaRows>& part) {
                  for (const ReplicaRows& rows : part) {
                    if (rows.table != "deleted_session") continue;
                    for (const ReplicaRow& row : rows.rows) {
                      if (row.values.empty()) continue;
                      primary.deleted_sessions.push_back(row.values[0]);
                    }
                  }
                  return absl::OkStatus();
                },
                [](const std::string&, const std::string&) { return absl::OkStatus(); })
            .status());
  }
  return RefuseExtras(OwnExtras(own, primary), options_.primary, options_.data_dir.string());
}

absl::Status Follower::Take(const ChangesAnswer& answer) {
  if (!answer.sessions.empty()) RIGCAL_RETURN_IF_ERROR(CheckRoom());
  ReplicaListing own;
  if (answer.shared) {
    RIGCAL_RETURN_IF_ERROR(TakeShared());
    RIGCAL_ASSIGN_OR_RETURN(own, own_.ListReplica());
    RIGCAL_RETURN_IF_ERROR(DeleteOthers(own, answer));
  }
  const auto sessions = MarksOf(own.sessions);
  for (const ReplicaRecord& record : answer.sessions) {
    const auto known = sessions.find(record.id);
    const bool same = answer.all && known != sessions.end() && known->second == record.mark;
    // After a start of either, or a takeover, rows here may be cut into other batches than there.
    if (!same) RIGCAL_RETURN_IF_ERROR(TakeRecord(ReplicaKind::kSession, record.id, answer.all));
    if (!same || answer.run_id != run_id_) NoteDurable(record.id);
  }
  const auto calibrations = MarksOf(own.calibrations);
  for (const ReplicaRecord& record : answer.calibrations) {
    const auto known = calibrations.find(record.id);
    if (answer.all && known != calibrations.end() && known->second == record.mark) continue;
    RIGCAL_RETURN_IF_ERROR(TakeRecord(ReplicaKind::kCalibration, record.id));
  }
  return answer.shared ? TakeRecord(ReplicaKind::kActivations, "") : absl::OkStatus();
}

absl::Status Follower::TakeShared() {
  return target_.WriteReplica(
      ReplicaKind::kShared, "", false, [&](const ReplicaTarget::TakeRows& take) {
        return link_.ReadRecord(ReplicaKind::kShared, "", {}, take,
                                [&](const std::string& name, const std::string& content) {
                                  return TakeFile(name, content);
                                });
      });
}

absl::Status Follower::TakeFile(const std::string& name, const std::string& content) {
  const std::filesystem::path ca = options_.data_dir / "identity" / "ca.crt";
  if (name == "agents.json" || name == "monitors.json") {
    return WriteDurableFile(options_.data_dir / name, content);
  }
  if (name == "identity/ca.crt") {
    const std::string own = ContentOf(ca);
    if (own != content && !std::exchange(told_other_ca_, true)) {
      spdlog::warn(
          "standby of {}: agents and clients on other PCs would not accept this server: its "
          "certificate authority is {}. Copy the folder `identity` of the primary's data folder "
          "into {}, once, over a connection that you trust, and restart the standby",
          options_.primary, own.empty() ? "missing" : "another one", options_.data_dir.string());
    }
    return absl::OkStatus();
  }
  // Whose certificates count: only where the keys are the primary's too.
  if (name != "identity/identities.json" && name != "identity/denied.json") {
    return absl::OkStatus();
  }
  std::error_code error;
  if (!std::filesystem::exists(options_.data_dir / "identity" / "ca.key", error)) {
    return absl::OkStatus();
  }
  return WriteDurableFile(options_.data_dir / name, content);
}

absl::Status Follower::DeleteOthers(const ReplicaListing& own, const ChangesAnswer& answer) {
  const auto erase = [&](ReplicaKind kind, const std::vector<ReplicaRecord>& ours,
                         const std::vector<ReplicaRecord>& theirs) {
    const std::set<std::string> there = IdsOf(theirs);
    for (const ReplicaRecord& record : ours) {
      if (there.contains(record.id)) continue;
      RIGCAL_RETURN_IF_ERROR(target_.EraseReplica(kind, record.id));
      spdlog::info("standby of {}: {} {} was deleted there, and is deleted here", options_.primary,
                   kind == ReplicaKind::kSession ? "session" : "calibration", record.id);
    }
    return absl::OkStatus();
  };
  RIGCAL_RETURN_IF_ERROR(erase(ReplicaKind::kSession, own.sessions, answer.sessions));
  return erase(ReplicaKind::kCalibration, own.calibrations, answer.calibrations);
}

absl::Status Follower::TakeRecord(ReplicaKind kind, const std::string& id, bool anew_at_once) {
  const auto no_file = [](const std::string&, const std::string&) { return absl::OkStatus(); };
  absl::Status status;
  for (const bool anew : {false, true}) {
    if (anew_at_once && !anew) continue;
    std::vector<ReplicaStream> streams;
    if (kind == ReplicaKind::kSession && !anew) {
      RIGCAL_ASSIGN_OR_RETURN(streams, target_.ReplicaStreams(id));
    }
    absl::Status read;
    status = target_.WriteReplica(
        kind, id, anew,
        [&](const ReplicaTarget::TakeRows& take) -> absl::StatusOr<std::vector<ReplicaDigest>> {
          auto digests = link_.ReadRecord(kind, id, streams, take, no_file);
          read = digests.status();
          return digests;
        });
    // Deleted since it was listed: the next answer says so.
    if (absl::IsNotFound(read)) return absl::OkStatus();
    if (status.ok() || absl::IsResourceExhausted(status) || absl::IsUnavailable(status) ||
        absl::IsCancelled(status)) {
      return status;
    }
    if (!anew) {
      spdlog::debug("standby: {} is read anew: {}", id, std::string(status.message()));
    }
  }
  return absl::Status(status.code(), absl::StrCat("copying ", id, " from ", options_.primary, ": ",
                                                  status.message()));
}

absl::Status Follower::CheckRoom() const {
  const StoreHealth health = store_.Health();
  if (health.reserve_bytes == 0 || health.room_bytes() >= health.reserve_bytes) {
    return absl::OkStatus();
  }
  return absl::ResourceExhaustedError(absl::StrCat(
      "the standby's disk is full: ", options_.data_dir.string(), " has ",
      health.room_bytes() >> 20, " MiB left, and ", health.reserve_bytes >> 20,
      " MiB are kept free (limits.disk_reserve_mb); free space there. The primary goes on"));
}

void Follower::NoteDurable(const std::string& session) {
  auto progress = target_.ReplicaProgress(session);
  if (!progress.ok()) return;
  for (StreamProgress& stream : *progress) durable_.push_back(std::move(stream));
}

}  // namespace rigcal::server
