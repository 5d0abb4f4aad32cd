// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "common/calibration/activation.h"
#include "common/calibration/calibration_record.h"
#include "common/session/session.h"
#include "common/session/stream_audit.h"
#include "server/store/calibration_job.h"
#include "server/store/delivery.h"
#include "server/store/record_list.h"
#include "server/store/replica.h"
#include "server/store/store_changes.h"

namespace rigcal::server {

struct StoreHealth {
  std::string kind;  // "sqlite", "postgresql"
  uint32_t schema_version = 0;
  uint64_t size_bytes = 0;
  uint64_t unused_bytes = 0;  // part of it that holds nothing; Compact gives it back
  // What is deleted becomes unused_bytes at once, and Compact works. False: the database does both
  // by itself, at some time.
  bool counts_unused = true;
  uint64_t free_bytes = 0;        // on its disk; 0, with no reserve: not known
  uint64_t reserve_bytes = 0;     // free space at which observations are refused
  std::string problem = {};       // why nothing can be written any more; empty: healthy
  bool replaced = false;          // another server writes now, and this one never will
  std::string read_problem = {};  // why something could not be read; what is written is safe

  // For observations: unused space of the store is filled before its files grow.
  uint64_t room_bytes() const { return free_bytes + unused_bytes; }
};

// Reads the observations of a session batch by batch, in the order of ReadObservations, and has one
// piece of at most about 1 MiB of them in memory. For one thread at a time.
class ObservationCursor {
 public:
  virtual ~ObservationCursor() = default;
  // None: that was all.
  virtual absl::StatusOr<std::optional<StoredBatch>> Next() = 0;
};

// Keeps sessions, observations and calibrations. Thread-safe. Every write is durable (survives
// kill -9 and power loss) when the call returns OK; a call that returns an error has changed
// nothing.
//
// Errors common to all: NOT_FOUND (the id is named), RESOURCE_EXHAUSTED (disk full; reads and
// deletes still work, and writes again once there is room; observations are refused before that,
// see StoreHealth::reserve_bytes), DATA_LOSS (a record's checksum is wrong; it is named),
// UNAVAILABLE (another program holds the store; try again), INTERNAL (an error of the disk: every
// later write is refused too, until the store is opened again).
class Store {
 public:
  virtual ~Store() = default;

  // Created with the store; never changes.
  virtual std::string server_id() const = 0;
  virtual StoreHealth Health() const = 0;

  // --- Sessions ---
  // An empty id is replaced by a new one ("s-000001"). ALREADY_EXISTS: also for the id of a deleted
  // session, so that late deliveries to that one cannot end in another.
  virtual absl::StatusOr<Session> CreateSession(Session session) = 0;
  // FAILED_PRECONDITION: it would lose a camera that has observations.
  virtual absl::Status UpdateSession(const Session& session) = 0;
  virtual absl::StatusOr<Session> GetSession(std::string_view id) const = 0;
  // Reads a summary of each session, not the session. A damaged record is in the list too, see
  // SessionSummary::damage.
  virtual absl::StatusOr<std::vector<Listed<SessionSummary>>> ListSessions(
      const SessionFilter& filter, const ListPage& page) const = 0;
  // Also one whose record is damaged.
  virtual absl::Status DeleteSession(std::string_view id) = 0;
  // The observations only, with their clock samples; the session, its counts and the positions of
  // its streams stay. Sets Session::observations_delete_utc_ns.
  virtual absl::Status DeleteObservations(std::string_view id, int64_t utc_ns) = 0;
  // One per camera of the session, in the order of their names.
  virtual absl::StatusOr<std::vector<SessionCameraCounts>> GetSessionCounts(
      std::string_view id) const = 0;

  // --- Observations ---
  // All deliveries in one transaction, in their order; one outcome for each. Rows that a stream has
  // already are skipped in the same transaction: any order and any repetition of deliveries ends in
  // the same rows.
  virtual absl::StatusOr<std::vector<AppendOutcome>> Append(
      absl::Span<const Delivery> deliveries) = 0;
  // 0 for a stream that has nothing yet. NOT_FOUND: no such session, or no such camera in it.
  virtual absl::StatusOr<StreamStatus> GetStream(const StreamKey& stream) const = 0;
  // Every stream of the session, by camera and stream epoch, with its stored rows read and their
  // checksums verified, in pieces between which others read. Damaged rows are noted as by
  // ReadObservations. Agent and holder are not filled in.
  virtual absl::StatusOr<std::vector<StreamAudit>> AuditStreams(std::string_view id) const = 0;
  // Calls `visit` for every stored batch of the session in the order (camera, stream_epoch, seq);
  // stops at the first error and returns it. Empty `camera`: all. `visit` may take its time and may
  // call the store; rows that arrive meanwhile may or may not be seen. A damaged record is visited
  // as such (StoredBatch::damage), and from then on counted in the camera's refusals.
  virtual absl::Status ReadObservations(
      std::string_view session_id, std::string_view camera,
      const std::function<absl::Status(StoredBatch)>& visit) const = 0;

  // The same for a caller that cannot wait in a callback. The store must outlive the cursor.
  virtual absl::StatusOr<std::unique_ptr<ObservationCursor>> OpenObservations(
      std::string_view session_id, std::string_view camera) const = 0;

  // --- Calibrations ---
  // Fills id ("c-000001") and version.
  virtual absl::StatusOr<Calibration> CreateCalibration(Calibration calibration) = 0;
  // FAILED_PRECONDITION: it has ended and is immutable.
  virtual absl::Status UpdateCalibration(const Calibration& calibration) = 0;
  virtual absl::StatusOr<Calibration> GetCalibration(std::string_view id) const = 0;
  // Summaries: without the cameras, the refusals and the covariances. A damaged record is in the
  // list too, see Calibration::damage; only id, rig, version and state are filled then.
  virtual absl::StatusOr<std::vector<Listed<Calibration>>> ListCalibrations(
      const CalibrationFilter& filter, const ListPage& page) const = 0;
  // FAILED_PRECONDITION: it is queued or running, or the active one of its rig.
  virtual absl::Status DeleteCalibration(std::string_view id) = 0;

  // --- Jobs ---
  // A calibration that has not ended is a job too, for whoever solves it: the server, and each
  // rigcal-worker where the store is shared by several processes. Who claims a job holds it for
  // kJobLease after its last heartbeat; in a store of one process until the job is ended.

  // Several processes take jobs from this store.
  virtual bool jobs_are_shared() const = 0;
  // The oldest job of the holder's software version that nobody holds, and begins its calibration.
  // None: there is none.
  virtual absl::StatusOr<std::optional<ClaimedJob>> ClaimJob(const JobHolder& holder,
                                                             const ClaimOptions& options) = 0;
  // The heartbeat; whether it is to be cancelled. ABORTED: the claim counts no more.
  virtual absl::StatusOr<bool> RenewJob(const JobClaim& claim, const JobProgress& progress) = 0;
  // Ends the job with what became of its calibration, or gives it back (kQueued, with its
  // attempt_count). Once: a second
  // call with the same claim and state changes nothing. ABORTED: the claim counts no more, and
  // nothing is stored.
  virtual absl::Status FinishJob(const JobClaim& claim, const Calibration& calibration) = 0;
  // Ends a queued calibration as cancelled, and asks the holder of a running one to do so. As it is
  // then; one that has ended stays as it is.
  virtual absl::StatusOr<Calibration> CancelJob(std::string_view id, int64_t utc_ns) = 0;
  // Those that have not ended, the oldest first.
  virtual absl::StatusOr<std::vector<CalibrationJob>> ListJobs() const = 0;
  // For a server that starts on this store: what earlier servers held is queued again (in a store
  // of one process: all), and what nobody holds is for its software version.
  virtual absl::Status AdoptJobs(std::string_view software_version) = 0;

  // The heartbeat of a rigcal-worker, also of one without a job; and its end.
  virtual absl::Status NoteWorker(const JobHolder& holder) = 0;
  virtual absl::Status ForgetWorker(const JobHolder& holder) = 0;
  virtual absl::StatusOr<std::vector<SolveWorker>> ListWorkers() const = 0;

  // --- Rigs ---
  // Those that have a session or a calibration, by name.
  virtual absl::StatusOr<std::vector<RigSummary>> ListRigs() const = 0;
  // Makes a calibration the active one of its rig; fills `number`. ABORTED: another one is active
  // than `previous_calibration_id` says.
  virtual absl::StatusOr<Activation> AddActivation(Activation activation) = 0;
  // Of one rig, newest first, at most `limit`.
  virtual absl::StatusOr<std::vector<Activation>> ListActivations(std::string_view rig,
                                                                  int limit) const = 0;

  // --- Care ---
  // Gives unused space back to the disk, in small steps between which others write. `progress` gets
  // the part that is done, 0 to 1; what it returns, unless OK, ends the work. UNIMPLEMENTED: where
  // StoreHealth::counts_unused is false; the message says what to do instead.
  virtual absl::Status Compact(const std::function<absl::Status(double)>& progress) = 0;

  // --- Standbys ---
  // Null: others cannot follow this store; its database has standbys of its own.
  virtual ReplicaSource* replica_source() { return nullptr; }
  virtual ReplicaTarget* replica_target() { return nullptr; }
  // What has changed in this run of the process.
  StoreChanges& changes() { return changes_; }

 private:
  StoreChanges changes_;
};

}  // namespace rigcal::server
