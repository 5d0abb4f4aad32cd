// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/store/store.h"
#include "server/store/stream_ledger.h"

namespace rigcal::testing {

// A store in memory for observations only, with delays and errors on demand. Thread-safe.
class FakeStore : public server::Store {
 public:
  // Holds the next Append until Release; returns when one is held.
  void Hold() {
    const std::lock_guard lock(mutex_);
    held_ = true;
  }
  void WaitUntilHeld() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return waiting_ > 0; });
  }
  void Release() {
    {
      const std::lock_guard lock(mutex_);
      held_ = false;
    }
    changed_.notify_all();
  }
  // Result of every Append from now on; OK: it stores.
  void SetStatus(absl::Status status) {
    const std::lock_guard lock(mutex_);
    status_ = std::move(status);
  }
  void SetFreeBytes(uint64_t bytes) {
    const std::lock_guard lock(mutex_);
    free_bytes_ = bytes;
  }
  void SetUnknownSession(std::string id) {
    const std::lock_guard lock(mutex_);
    unknown_session_ = std::move(id);
  }

  // Number of deliveries of each Append so far, failed ones included.
  std::vector<size_t> group_sizes() const {
    const std::lock_guard lock(mutex_);
    return group_sizes_;
  }
  std::vector<server::Delivery> deliveries() const {
    const std::lock_guard lock(mutex_);
    return deliveries_;
  }

  absl::StatusOr<std::vector<server::AppendOutcome>> Append(
      absl::Span<const server::Delivery> deliveries) override {
    std::unique_lock lock(mutex_);
    group_sizes_.push_back(deliveries.size());
    ++waiting_;
    changed_.notify_all();
    changed_.wait(lock, [this] { return !held_; });
    --waiting_;
    if (!status_.ok()) return status_;
    std::vector<server::AppendOutcome> outcomes;
    for (const server::Delivery& delivery : deliveries) {
      deliveries_.push_back(delivery);
      outcomes.push_back(Store(delivery));
    }
    return outcomes;
  }
  server::StoreHealth Health() const override {
    const std::lock_guard lock(mutex_);
    server::StoreHealth health;
    health.free_bytes = free_bytes_;
    return health;
  }

  std::string server_id() const override { return "fake"; }
  absl::StatusOr<Session> CreateSession(Session) override { return None(); }
  absl::Status UpdateSession(const Session&) override { return None(); }
  absl::StatusOr<Session> GetSession(std::string_view) const override { return None(); }
  absl::StatusOr<std::vector<server::Listed<SessionSummary>>> ListSessions(
      const server::SessionFilter&, const server::ListPage&) const override {
    return None();
  }
  absl::Status DeleteSession(std::string_view) override { return None(); }
  absl::Status DeleteObservations(std::string_view, int64_t) override { return None(); }
  absl::StatusOr<std::vector<SessionCameraCounts>> GetSessionCounts(
      std::string_view) const override {
    return None();
  }
  absl::StatusOr<StreamStatus> GetStream(const StreamKey&) const override { return None(); }
  absl::StatusOr<std::vector<StreamAudit>> AuditStreams(std::string_view) const override {
    return None();
  }
  absl::Status ReadObservations(
      std::string_view, std::string_view,
      const std::function<absl::Status(server::StoredBatch)>&) const override {
    return None();
  }
  absl::StatusOr<std::unique_ptr<server::ObservationCursor>> OpenObservations(
      std::string_view, std::string_view) const override {
    return None();
  }
  absl::StatusOr<Calibration> CreateCalibration(Calibration) override { return None(); }
  absl::Status UpdateCalibration(const Calibration&) override { return None(); }
  absl::StatusOr<Calibration> GetCalibration(std::string_view) const override { return None(); }
  absl::StatusOr<std::vector<server::Listed<Calibration>>> ListCalibrations(
      const server::CalibrationFilter&, const server::ListPage&) const override {
    return None();
  }
  absl::Status DeleteCalibration(std::string_view) override { return None(); }
  bool jobs_are_shared() const override { return false; }
  absl::StatusOr<std::optional<server::ClaimedJob>> ClaimJob(const server::JobHolder&,
                                                             const server::ClaimOptions&) override {
    return None();
  }
  absl::StatusOr<bool> RenewJob(const server::JobClaim&, const server::JobProgress&) override {
    return None();
  }
  absl::Status FinishJob(const server::JobClaim&, const Calibration&) override { return None(); }
  absl::StatusOr<Calibration> CancelJob(std::string_view, int64_t) override { return None(); }
  absl::StatusOr<std::vector<server::CalibrationJob>> ListJobs() const override { return None(); }
  absl::Status AdoptJobs(std::string_view) override { return None(); }
  absl::Status NoteWorker(const server::JobHolder&) override { return None(); }
  absl::Status ForgetWorker(const server::JobHolder&) override { return None(); }
  absl::StatusOr<std::vector<server::SolveWorker>> ListWorkers() const override { return None(); }
  absl::StatusOr<std::vector<server::RigSummary>> ListRigs() const override { return None(); }
  absl::StatusOr<Activation> AddActivation(Activation) override { return None(); }
  absl::StatusOr<std::vector<Activation>> ListActivations(std::string_view, int) const override {
    return None();
  }
  absl::Status Compact(const std::function<absl::Status(double)>&) override { return None(); }

 private:
  static absl::Status None() { return absl::UnimplementedError("the fake store has none"); }

  server::AppendOutcome Store(const server::Delivery& delivery) {
    server::AppendOutcome outcome;
    if (delivery.stream().session_id == unknown_session_) {
      outcome.unknown = true;
      return outcome;
    }
    Stream& stream = streams_[delivery.stream()];
    const server::SeqRange rows{delivery.batch.first_seq, delivery.batch.end_seq()};
    for (const server::SeqRange& range : stream.ledger.Missing(rows)) {
      outcome.stored_rows += range.size();
      stream.ledger.Add(range);
    }
    outcome.duplicate_rows = static_cast<uint32_t>(delivery.batch.rows()) - outcome.stored_rows;
    outcome.refused_rows = static_cast<uint32_t>(delivery.refused_rows.size());
    outcome.stored_rows -= outcome.refused_rows;
    for (const DroppedRange& dropped : delivery.batch.dropped) {
      stream.ledger.Add({dropped.first_seq, dropped.first_seq + dropped.count});
    }
    if (delivery.last_seq) stream.last_seq = delivery.last_seq;
    outcome.durable_seq = stream.ledger.durable_seq();
    outcome.complete = stream.last_seq && outcome.durable_seq >= *stream.last_seq;
    return outcome;
  }

  struct Stream {
    server::StreamLedger ledger;
    std::optional<uint32_t> last_seq;
  };

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  bool held_ = false;
  int waiting_ = 0;
  absl::Status status_;
  uint64_t free_bytes_ = 0;
  std::string unknown_session_;
  std::vector<size_t> group_sizes_;
  std::vector<server::Delivery> deliveries_;
  std::map<StreamKey, Stream> streams_;
};

}  // namespace rigcal::testing
