// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/sql/damage_note.h"
#include "server/store/sql/observation_writer.h"
#include "server/store/sql/sql_database.h"
#include "server/store/sql/table_copy.h"
#include "server/store/store.h"

namespace rigcal::server {

// A store whose records and rows are in the tables of this folder, whatever database has them.
class SqlStore : public Store, public ReplicaSource, public ReplicaTarget {
 public:
  // Everything of `source`, its identity too, into this store, which must be empty, in one
  // transaction. Read back and compared by digests of both sides. What was copied, by table.
  //   FAILED_PRECONDITION  this store is not empty
  //   DATA_LOSS            the copy differs from the source
  absl::StatusOr<std::vector<CopiedTable>> CopyFrom(const SqlStore& source);

  absl::StatusOr<Session> CreateSession(Session session) override;
  absl::Status UpdateSession(const Session& session) override;
  absl::StatusOr<Session> GetSession(std::string_view id) const override;
  absl::StatusOr<std::vector<Listed<SessionSummary>>> ListSessions(
      const SessionFilter& filter, const ListPage& page) const override;
  absl::Status DeleteSession(std::string_view id) override;
  absl::Status DeleteObservations(std::string_view id, int64_t utc_ns) override;
  absl::StatusOr<std::vector<SessionCameraCounts>> GetSessionCounts(
      std::string_view id) const override;

  absl::StatusOr<std::vector<AppendOutcome>> Append(absl::Span<const Delivery> deliveries) override;
  absl::StatusOr<StreamStatus> GetStream(const StreamKey& stream) const override;
  absl::StatusOr<std::vector<StreamAudit>> AuditStreams(std::string_view id) const override;
  absl::StatusOr<std::unique_ptr<ObservationCursor>> OpenObservations(
      std::string_view session_id, std::string_view camera) const override;
  absl::Status ReadObservations(
      std::string_view session_id, std::string_view camera,
      const std::function<absl::Status(StoredBatch)>& visit) const override;

  absl::StatusOr<Calibration> CreateCalibration(Calibration calibration) override;
  absl::Status UpdateCalibration(const Calibration& calibration) override;
  absl::StatusOr<Calibration> GetCalibration(std::string_view id) const override;
  absl::StatusOr<std::vector<Listed<Calibration>>> ListCalibrations(
      const CalibrationFilter& filter, const ListPage& page) const override;
  absl::Status DeleteCalibration(std::string_view id) override;
  bool jobs_are_shared() const override { return false; }
  absl::StatusOr<std::optional<ClaimedJob>> ClaimJob(const JobHolder& holder,
                                                     const ClaimOptions& options) override;
  absl::StatusOr<bool> RenewJob(const JobClaim& claim, const JobProgress& progress) override;
  absl::Status FinishJob(const JobClaim& claim, const Calibration& calibration) override;
  absl::StatusOr<Calibration> CancelJob(std::string_view id, int64_t utc_ns) override;
  absl::StatusOr<std::vector<CalibrationJob>> ListJobs() const override;
  absl::Status AdoptJobs(std::string_view software_version) override;
  absl::Status NoteWorker(const JobHolder& holder) override;
  absl::Status ForgetWorker(const JobHolder& holder) override;
  absl::StatusOr<std::vector<SolveWorker>> ListWorkers() const override;
  absl::StatusOr<std::vector<RigSummary>> ListRigs() const override;
  absl::StatusOr<Activation> AddActivation(Activation activation) override;
  absl::StatusOr<std::vector<Activation>> ListActivations(std::string_view rig,
                                                          int limit) const override;

  absl::StatusOr<uint64_t> Generation() const override;
  absl::StatusOr<ReplicaListing> ListReplica() const override;
  absl::StatusOr<std::vector<ReplicaDigest>> ReadReplica(
      ReplicaKind kind, const std::string& id, const std::vector<ReplicaStream>& streams,
      const std::function<absl::Status(std::vector<ReplicaRows>)>& take) const override;

  absl::StatusOr<std::vector<ReplicaStream>> ReplicaStreams(const std::string& id) const override;
  absl::StatusOr<std::vector<StreamProgress>> ReplicaProgress(const std::string& id) const override;
  absl::Status WriteReplica(
      ReplicaKind kind, const std::string& id, bool anew,
      const std::function<absl::StatusOr<std::vector<ReplicaDigest>>(const TakeRows&)>& read)
      override;
  absl::Status EraseReplica(ReplicaKind kind, const std::string& id) override;
  absl::StatusOr<uint64_t> RaiseGeneration() override;

 protected:
  SqlStore() = default;
  // From here on; both must outlive this store's use of them. May throw the database's errors.
  void Use(SqlWriter* writer, SqlReader* reader);
  // Before the writer ends.
  void ForgetStatements() { observations_.reset(); }

  // Inside a transaction that has added rows with numbers of their own.
  virtual void NoteForeignNumbers(SqlDatabase&) {}
  // Inside each transaction that changes how much is stored, at its end.
  virtual void NoteSize() {}
  // Runs `erase`, a transaction that makes room.
  virtual absl::Status Erase(const std::function<absl::Status()>& erase) { return erase(); }

 private:
  // Of a claim; 0: it has no end.
  int64_t lease_ms() const { return jobs_are_shared() ? kJobLease.count() : 0; }
  // Changes sessions, and clears the observation writer's copies of them.
  absl::Status ChangeSessions(std::string_view what, const SqlWriter::Work& change);
  // Once for each damaged batch.
  void NoteDamagedBatches(const std::vector<DamageNote>& damaged) const;

  SqlWriter* writer_ = nullptr;
  SqlReader* reader_ = nullptr;
  std::unique_ptr<ObservationWriter> observations_;  // used in the writer's transactions only
};

}  // namespace rigcal::server
