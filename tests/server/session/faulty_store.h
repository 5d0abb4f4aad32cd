// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/store/store.h"

namespace rigcal::testing {

// Forwards to another store; calls fail on demand. Thread-safe.
class FaultyStore : public server::Store {
 public:
  explicit FaultyStore(server::Store* store) : store_(*store) {}

  // From now on `method` ("UpdateSession") returns `status`; OK: works again.
  void Fail(const std::string& method, absl::Status status) {
    std::lock_guard lock(mutex_);
    faults_[method] = std::move(status);
  }
  // `hook` runs at the beginning of every call of `method`.
  void OnCall(const std::string& method, std::function<void()> hook) {
    std::lock_guard lock(mutex_);
    hooks_[method] = std::move(hook);
  }
  int CallCount(const std::string& method) const {
    std::lock_guard lock(mutex_);
    const auto count = counts_.find(method);
    return count == counts_.end() ? 0 : count->second;
  }

  std::string server_id() const override { return store_.server_id(); }
  server::StoreHealth Health() const override {
    server::StoreHealth health = store_.Health();
    if (absl::Status status = Enter("Health"); !status.ok()) {
      health.problem = std::string(status.message());
    }
    return health;
  }

  absl::StatusOr<Session> CreateSession(Session session) override {
    if (absl::Status status = Enter("CreateSession"); !status.ok()) return status;
    return store_.CreateSession(std::move(session));
  }
  absl::Status UpdateSession(const Session& session) override {
    if (absl::Status status = Enter("UpdateSession"); !status.ok()) return status;
    return store_.UpdateSession(session);
  }
  absl::StatusOr<Session> GetSession(std::string_view id) const override {
    if (absl::Status status = Enter("GetSession"); !status.ok()) return status;
    return store_.GetSession(id);
  }
  absl::StatusOr<std::vector<server::Listed<SessionSummary>>> ListSessions(
      const server::SessionFilter& filter, const server::ListPage& page) const override {
    if (absl::Status status = Enter("ListSessions"); !status.ok()) return status;
    return store_.ListSessions(filter, page);
  }
  absl::Status DeleteSession(std::string_view id) override {
    if (absl::Status status = Enter("DeleteSession"); !status.ok()) return status;
    return store_.DeleteSession(id);
  }
  absl::Status DeleteObservations(std::string_view id, int64_t utc_ns) override {
    if (absl::Status status = Enter("DeleteObservations"); !status.ok()) return status;
    return store_.DeleteObservations(id, utc_ns);
  }
  absl::StatusOr<std::vector<SessionCameraCounts>> GetSessionCounts(
      std::string_view id) const override {
    if (absl::Status status = Enter("GetSessionCounts"); !status.ok()) return status;
    return store_.GetSessionCounts(id);
  }
  absl::StatusOr<std::vector<server::AppendOutcome>> Append(
      absl::Span<const server::Delivery> deliveries) override {
    if (absl::Status status = Enter("Append"); !status.ok()) return status;
    return store_.Append(deliveries);
  }
  absl::StatusOr<StreamStatus> GetStream(const StreamKey& stream) const override {
    if (absl::Status status = Enter("GetStream"); !status.ok()) return status;
    return store_.GetStream(stream);
  }
  absl::StatusOr<std::vector<StreamAudit>> AuditStreams(std::string_view id) const override {
    if (absl::Status status = Enter("AuditStreams"); !status.ok()) return status;
    return store_.AuditStreams(id);
  }
  absl::Status ReadObservations(
      std::string_view session_id, std::string_view camera,
      const std::function<absl::Status(server::StoredBatch)>& visit) const override {
    if (absl::Status status = Enter("ReadObservations"); !status.ok()) return status;
    return store_.ReadObservations(session_id, camera, visit);
  }
  absl::StatusOr<std::unique_ptr<server::ObservationCursor>> OpenObservations(
      std::string_view session_id, std::string_view camera) const override {
    if (absl::Status status = Enter("ReadObservations"); !status.ok()) return status;
    return store_.OpenObservations(session_id, camera);
  }
  absl::StatusOr<Calibration> CreateCalibration(Calibration calibration) override {
    if (absl::Status status = Enter("CreateCalibration"); !status.ok()) return status;
    return store_.CreateCalibration(std::move(calibration));
  }
  absl::Status UpdateCalibration(const Calibration& calibration) override {
    if (absl::Status status = Enter("UpdateCalibration"); !status.ok()) return status;
    return store_.UpdateCalibration(calibration);
  }
  absl::StatusOr<Calibration> GetCalibration(std::string_view id) const override {
    if (absl::Status status = Enter("GetCalibration"); !status.ok()) return status;
    return store_.GetCalibration(id);
  }
  absl::StatusOr<std::vector<server::Listed<Calibration>>> ListCalibrations(
      const server::CalibrationFilter& filter, const server::ListPage& page) const override {
    if (absl::Status status = Enter("ListCalibrations"); !status.ok()) return status;
    return store_.ListCalibrations(filter, page);
  }
  absl::Status DeleteCalibration(std::string_view id) override {
    if (absl::Status status = Enter("DeleteCalibration"); !status.ok()) return status;
    return store_.DeleteCalibration(id);
  }
  bool jobs_are_shared() const override { return jobs_are_shared_ || store_.jobs_are_shared(); }
  // As a store that several processes use.
  void ShareJobs() { jobs_are_shared_ = true; }
  absl::StatusOr<std::optional<server::ClaimedJob>> ClaimJob(
      const server::JobHolder& holder, const server::ClaimOptions& options) override {
    if (absl::Status status = Enter("ClaimJob"); !status.ok()) return status;
    return store_.ClaimJob(holder, options);
  }
  absl::StatusOr<bool> RenewJob(const server::JobClaim& claim,
                                const server::JobProgress& progress) override {
    if (absl::Status status = Enter("RenewJob"); !status.ok()) return status;
    return store_.RenewJob(claim, progress);
  }
  absl::Status FinishJob(const server::JobClaim& claim, const Calibration& calibration) override {
    if (absl::Status status = Enter("FinishJob"); !status.ok()) return status;
    return store_.FinishJob(claim, calibration);
  }
  absl::StatusOr<Calibration> CancelJob(std::string_view id, int64_t utc_ns) override {
    if (absl::Status status = Enter("CancelJob"); !status.ok()) return status;
    return store_.CancelJob(id, utc_ns);
  }
  absl::StatusOr<std::vector<server::CalibrationJob>> ListJobs() const override {
    if (absl::Status status = Enter("ListJobs"); !status.ok()) return status;
    return store_.ListJobs();
  }
  absl::Status AdoptJobs(std::string_view software_version) override {
    if (absl::Status status = Enter("AdoptJobs"); !status.ok()) return status;
    return store_.AdoptJobs(software_version);
  }
  absl::Status NoteWorker(const server::JobHolder& holder) override {
    return store_.NoteWorker(holder);
  }
  absl::Status ForgetWorker(const server::JobHolder& holder) override {
    return store_.ForgetWorker(holder);
  }
  absl::StatusOr<std::vector<server::SolveWorker>> ListWorkers() const override {
    return store_.ListWorkers();
  }
  absl::StatusOr<std::vector<server::RigSummary>> ListRigs() const override {
    if (absl::Status status = Enter("ListRigs"); !status.ok()) return status;
    return store_.ListRigs();
  }
  absl::StatusOr<Activation> AddActivation(Activation activation) override {
    if (absl::Status status = Enter("AddActivation"); !status.ok()) return status;
    return store_.AddActivation(std::move(activation));
  }
  absl::StatusOr<std::vector<Activation>> ListActivations(std::string_view rig,
                                                          int limit) const override {
    if (absl::Status status = Enter("ListActivations"); !status.ok()) return status;
    return store_.ListActivations(rig, limit);
  }
  absl::Status Compact(const std::function<absl::Status(double)>& progress) override {
    if (absl::Status status = Enter("Compact"); !status.ok()) return status;
    absl::Status status = store_.Compact(progress);
    (void)Enter(absl::IsCancelled(status) ? "CompactCancelled" : "CompactEnd");
    return status;
  }

 private:
  absl::Status Enter(const std::string& method) const {
    std::function<void()> hook;
    absl::Status status;
    {
      std::lock_guard lock(mutex_);
      ++counts_[method];
      if (const auto found = hooks_.find(method); found != hooks_.end()) hook = found->second;
      if (const auto found = faults_.find(method); found != faults_.end()) status = found->second;
    }
    if (hook) hook();
    return status;
  }

  server::Store& store_;
  bool jobs_are_shared_ = false;
  mutable std::mutex mutex_;
  std::map<std::string, absl::Status> faults_;
  std::map<std::string, std::function<void()>> hooks_;
  mutable std::map<std::string, int> counts_;
};

}  // namespace rigcal::testing
