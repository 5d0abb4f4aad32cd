// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/sql_store.h"

#include <spdlog/spdlog.h>

#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/store/row_account.h"
#include "server/store/sql/activation_table.h"
#include "server/store/sql/calibration_table.h"
#include "server/store/sql/counter_table.h"
#include "server/store/sql/job_table.h"
#include "server/store/sql/observation_reader.h"
#include "server/store/sql/replica_reader.h"
#include "server/store/sql/replica_writer.h"
#include "server/store/sql/session_table.h"

namespace rigcal::server {

void SqlStore::Use(SqlWriter* writer, SqlReader* reader) {
  writer_ = writer;
  reader_ = reader;
  observations_ = std::make_unique<ObservationWriter>(writer_->sql());
}

absl::StatusOr<std::vector<CopiedTable>> SqlStore::CopyFrom(const SqlStore& source) {
  std::vector<CopiedTable> copied;
  const auto copy = [&](SqlDatabase& from) {
    return writer_->Transact("copying", [&](SqlDatabase& to) {
      absl::Status empty = CheckTablesAreEmpty(to);
      if (!empty.ok()) return empty;
      copied = CopyTables(from, to);
      NoteForeignNumbers(to);
      NoteSize();
      return absl::OkStatus();
    });
  };
  RIGCAL_RETURN_IF_ERROR(source.reader_->ReadWith("reading the source", copy));
  RIGCAL_ASSIGN_OR_RETURN(
      const std::vector<CopiedTable> read_back,
      reader_->Read("reading the copy back",
                    [](SqlDatabase& database) -> absl::StatusOr<std::vector<CopiedTable>> {
                      return DigestTables(database);
                    }));
  RIGCAL_RETURN_IF_ERROR(CompareCopies(copied, read_back));
  return copied;
}

absl::Status SqlStore::ChangeSessions(std::string_view what, const SqlWriter::Work& change) {
  return writer_->Transact(what, [&](SqlDatabase& database) {
    observations_->Forget();
    absl::Status status = change(database);
    NoteSize();
    return status;
  });
}

absl::StatusOr<Session> SqlStore::CreateSession(Session session) {
  Session stored;
  RIGCAL_RETURN_IF_ERROR(
      ChangeSessions("storing a session", [&](SqlDatabase& database) -> absl::Status {
        RIGCAL_ASSIGN_OR_RETURN(stored, InsertSession(database, session));
        return absl::OkStatus();
      }));
  changes().NoteShared();
  changes().NoteSession(stored.id);
  return stored;
}

absl::Status SqlStore::UpdateSession(const Session& session) {
  RIGCAL_RETURN_IF_ERROR(
      ChangeSessions(absl::StrCat("storing session ", session.id),
                     [&](SqlDatabase& database) { return ReplaceSession(database, session); }));
  changes().NoteSession(session.id);
  return absl::OkStatus();
}

absl::StatusOr<Session> SqlStore::GetSession(std::string_view id) const {
  return reader_->Read("reading a session",
                       [&](SqlDatabase& database) { return FindSession(database, id); });
}

absl::StatusOr<std::vector<Listed<SessionSummary>>> SqlStore::ListSessions(
    const SessionFilter& filter, const ListPage& page) const {
  return reader_->Read(
      "listing sessions",
      [&](SqlDatabase& database) -> absl::StatusOr<std::vector<Listed<SessionSummary>>> {
        return server::ListSessions(database, filter, page);
      });
}

absl::Status SqlStore::DeleteSession(std::string_view id) {
  RIGCAL_RETURN_IF_ERROR(Erase([&] {
    return ChangeSessions(absl::StrCat("deleting session ", std::string(id)),
                          [&](SqlDatabase& database) { return EraseSession(database, id); });
  }));
  changes().NoteShared();
  return absl::OkStatus();
}

absl::Status SqlStore::DeleteObservations(std::string_view id, int64_t utc_ns) {
  RIGCAL_RETURN_IF_ERROR(Erase([&] {
    return ChangeSessions(
        absl::StrCat("deleting the observations of session ", std::string(id)),
        [&](SqlDatabase& database) { return EraseObservations(database, id, utc_ns); });
  }));
  changes().NoteSession(id);
  return absl::OkStatus();
}

absl::StatusOr<std::vector<SessionCameraCounts>> SqlStore::GetSessionCounts(
    std::string_view id) const {
  return reader_->Read("reading counts",
                       [&](SqlDatabase& database) { return ReadSessionCounts(database, id); });
}

absl::StatusOr<std::vector<AppendOutcome>> SqlStore::Append(absl::Span<const Delivery> deliveries) {
  std::vector<AppendOutcome> outcomes;
  RIGCAL_RETURN_IF_ERROR(writer_->Transact(
      "storing observations",
      [&](SqlDatabase&) {
        observations_->Append(deliveries, &outcomes);
        NoteSize();
        return absl::OkStatus();
      },
      [&] { observations_->Forget(); }));
  std::map<std::string_view, uint64_t> rows;
  for (size_t i = 0; i < deliveries.size(); ++i) {
    if (!outcomes[i].unknown) rows[deliveries[i].stream().session_id] += outcomes[i].stored_rows;
  }
  for (const auto& [session, count] : rows) changes().NoteSession(session, count);
  return outcomes;
}

absl::StatusOr<StreamStatus> SqlStore::GetStream(const StreamKey& stream) const {
  return reader_->Read("reading a stream's position",
                       [&](SqlDatabase& database) { return ReadStreamStatus(database, stream); });
}

absl::StatusOr<std::vector<StreamAudit>> SqlStore::AuditStreams(std::string_view id) const {
  RIGCAL_ASSIGN_OR_RETURN(std::vector<AuditedStream> streams,
                          reader_->Read("counting stored rows", [&](SqlDatabase& database) {
                            return ListAuditedStreams(database, id);
                          }));
  std::vector<RowAccount> accounts;
  for (AuditedStream& stream : streams) {
    accounts.emplace_back(stream.audit, stream.dropped, stream.last_first_seq);
  }
  // Both are in the same order; a stream that began meanwhile is in the rows only.
  size_t current = 0;
  RIGCAL_RETURN_IF_ERROR(ReadObservations(id, "", [&](const StoredBatch& stored) {
    const StreamKey& key = stored.batch.stream;
    const size_t from = current;
    while (current < streams.size() && streams[current].audit.stream != key) ++current;
    if (current == streams.size()) {
      current = from;
    } else {
      accounts[current].Add(stored);
    }
    return absl::OkStatus();
  }));
  std::vector<StreamAudit> audits;
  for (RowAccount& account : accounts) audits.push_back(std::move(account).Close());
  return audits;
}

absl::Status SqlStore::ReadObservations(
    std::string_view session_id, std::string_view camera,
    const std::function<absl::Status(StoredBatch)>& visit) const {
  RIGCAL_ASSIGN_OR_RETURN(const auto cursor, OpenObservations(session_id, camera));
  while (true) {
    RIGCAL_ASSIGN_OR_RETURN(std::optional<StoredBatch> stored, cursor->Next());
    if (!stored) return absl::OkStatus();
    RIGCAL_RETURN_IF_ERROR(visit(*std::move(stored)));
  }
}

void SqlStore::NoteDamagedBatches(const std::vector<DamageNote>& damaged) const {
  if (damaged.empty()) return;
  const auto added = reader_->Read(
      "reading counts", [&](SqlDatabase& database) -> absl::StatusOr<std::vector<DamageNote>> {
        return NewDamage(database, damaged);
      });
  if (!added.ok() || added->empty()) return;
  spdlog::error("{} stored batches are damaged and left out, the first: {}", added->size(),
                added->front().example);
  const absl::Status noted =
      writer_->Transact("counting damaged observations", [&](SqlDatabase& database) {
        NoteDamage(database, *added);
        return absl::OkStatus();
      });
  // What reads them counts them itself; the next one tries to note them again.
  if (!noted.ok()) spdlog::warn("{}", std::string(noted.message()));
}

absl::StatusOr<std::unique_ptr<ObservationCursor>> SqlStore::OpenObservations(
    std::string_view session_id, std::string_view camera) const {
  return server::OpenObservations(
      *reader_, session_id, camera,
      [this](const std::vector<DamageNote>& damaged) { NoteDamagedBatches(damaged); });
}

absl::StatusOr<Calibration> SqlStore::CreateCalibration(Calibration calibration) {
  Calibration stored;
  RIGCAL_RETURN_IF_ERROR(
      writer_->Transact("storing a calibration", [&](SqlDatabase& database) -> absl::Status {
        RIGCAL_ASSIGN_OR_RETURN(stored, InsertCalibration(database, calibration));
        return absl::OkStatus();
      }));
  changes().NoteShared();
  changes().NoteCalibration(stored.id);
  return stored;
}

absl::Status SqlStore::UpdateCalibration(const Calibration& calibration) {
  RIGCAL_RETURN_IF_ERROR(writer_->Transact(
      absl::StrCat("storing calibration ", calibration.id),
      [&](SqlDatabase& database) { return ReplaceCalibration(database, calibration); }));
  changes().NoteCalibration(calibration.id);
  return absl::OkStatus();
}

absl::StatusOr<Calibration> SqlStore::GetCalibration(std::string_view id) const {
  return reader_->Read("reading a calibration",
                       [&](SqlDatabase& database) { return FindCalibration(database, id); });
}

absl::StatusOr<std::vector<Listed<Calibration>>> SqlStore::ListCalibrations(
    const CalibrationFilter& filter, const ListPage& page) const {
  return reader_->Read(
      "listing calibrations",
      [&](SqlDatabase& database) -> absl::StatusOr<std::vector<Listed<Calibration>>> {
        return server::ListCalibrations(database, filter, page);
      });
}

absl::Status SqlStore::DeleteCalibration(std::string_view id) {
  RIGCAL_RETURN_IF_ERROR(Erase([&] {
    return writer_->Transact(absl::StrCat("deleting calibration ", std::string(id)),
                             [&](SqlDatabase& database) {
                               absl::Status status = EraseCalibration(database, id);
                               NoteSize();
                               return status;
                             });
  }));
  changes().NoteShared();
  return absl::OkStatus();
}

absl::StatusOr<std::optional<ClaimedJob>> SqlStore::ClaimJob(const JobHolder& holder,
                                                             const ClaimOptions& options) {
  std::optional<ClaimedJob> claimed;
  RIGCAL_RETURN_IF_ERROR(
      writer_->Transact("claiming a calibration", [&](SqlDatabase& database) -> absl::Status {
        RIGCAL_ASSIGN_OR_RETURN(claimed, server::ClaimJob(database, holder, options, lease_ms()));
        return absl::OkStatus();
      }));
  if (claimed) changes().NoteCalibration(claimed->claim.calibration_id);
  return claimed;
}

absl::StatusOr<bool> SqlStore::RenewJob(const JobClaim& claim, const JobProgress& progress) {
  bool cancel = false;
  RIGCAL_RETURN_IF_ERROR(writer_->Transact(
      absl::StrCat("renewing the claim on calibration ", claim.calibration_id),
      [&](SqlDatabase& database) -> absl::Status {
        RIGCAL_ASSIGN_OR_RETURN(cancel, server::RenewJob(database, claim, progress, lease_ms()));
        return absl::OkStatus();
      }));
  return cancel;
}

absl::Status SqlStore::FinishJob(const JobClaim& claim, const Calibration& calibration) {
  RIGCAL_RETURN_IF_ERROR(writer_->Transact(
      absl::StrCat("storing calibration ", calibration.id),
      [&](SqlDatabase& database) { return server::FinishJob(database, claim, calibration); }));
  changes().NoteCalibration(calibration.id);
  return absl::OkStatus();
}

absl::StatusOr<Calibration> SqlStore::CancelJob(std::string_view id, int64_t utc_ns) {
  Calibration calibration;
  RIGCAL_RETURN_IF_ERROR(writer_->Transact(
      absl::StrCat("cancelling calibration ", std::string(id)),
      [&](SqlDatabase& database) -> absl::Status {
        RIGCAL_ASSIGN_OR_RETURN(calibration, server::CancelJob(database, id, utc_ns));
        return absl::OkStatus();
      }));
  changes().NoteCalibration(id);
  return calibration;
}

absl::StatusOr<std::vector<CalibrationJob>> SqlStore::ListJobs() const {
  return reader_->Read("listing the queue of calibrations", [&](SqlDatabase& database) {
    return server::ListJobs(database, lease_ms());
  });
}

absl::Status SqlStore::AdoptJobs(std::string_view software_version) {
  return writer_->Transact("queueing calibrations again", [&](SqlDatabase& database) {
    server::AdoptJobs(database, software_version, !jobs_are_shared(), lease_ms());
    return absl::OkStatus();
  });
}

absl::Status SqlStore::NoteWorker(const JobHolder& holder) {
  return writer_->Transact("noting a worker", [&](SqlDatabase& database) {
    server::NoteWorker(database, holder);
    return absl::OkStatus();
  });
}

absl::Status SqlStore::ForgetWorker(const JobHolder& holder) {
  return writer_->Transact("forgetting a worker", [&](SqlDatabase& database) {
    server::ForgetWorker(database, holder);
    return absl::OkStatus();
  });
}

absl::StatusOr<std::vector<SolveWorker>> SqlStore::ListWorkers() const {
  return reader_->Read("listing the workers",
                       [&](SqlDatabase& database) -> absl::StatusOr<std::vector<SolveWorker>> {
                         return server::ListWorkers(database);
                       });
}

absl::StatusOr<std::vector<RigSummary>> SqlStore::ListRigs() const {
  return reader_->Read("listing rigs",
                       [](SqlDatabase& database) -> absl::StatusOr<std::vector<RigSummary>> {
                         return server::ListRigs(database);
                       });
}

absl::StatusOr<Activation> SqlStore::AddActivation(Activation activation) {
  Activation stored;
  RIGCAL_RETURN_IF_ERROR(
      writer_->Transact("storing an activation", [&](SqlDatabase& database) -> absl::Status {
        RIGCAL_ASSIGN_OR_RETURN(stored, InsertActivation(database, activation));
        return absl::OkStatus();
      }));
  changes().NoteShared();
  return stored;
}

absl::StatusOr<std::vector<Activation>> SqlStore::ListActivations(std::string_view rig,
                                                                  int limit) const {
  return reader_->Read("reading a rig's history", [&](SqlDatabase& database) {
    return server::ListActivations(database, rig, limit);
  });
}

absl::StatusOr<uint64_t> SqlStore::Generation() const {
  return reader_->Read(
      "reading the generation",
      [](SqlDatabase& database) -> absl::StatusOr<uint64_t> { return ReadGeneration(database); });
}

absl::StatusOr<ReplicaListing> SqlStore::ListReplica() const {
  return reader_->Read("listing for a standby",
                       [](SqlDatabase& database) -> absl::StatusOr<ReplicaListing> {
                         return server::ListReplica(database);
                       });
}

absl::StatusOr<std::vector<ReplicaDigest>> SqlStore::ReadReplica(
    ReplicaKind kind, const std::string& id, const std::vector<ReplicaStream>& streams,
    const std::function<absl::Status(std::vector<ReplicaRows>)>& take) const {
  return server::ReadReplica(*reader_, kind, id, streams, take);
}

absl::StatusOr<std::vector<ReplicaStream>> SqlStore::ReplicaStreams(const std::string& id) const {
  return reader_->Read("reading what a standby has",
                       [&](SqlDatabase& database) -> absl::StatusOr<std::vector<ReplicaStream>> {
                         return ReadReplicaStreams(database, id);
                       });
}

absl::StatusOr<std::vector<StreamProgress>> SqlStore::ReplicaProgress(const std::string& id) const {
  return reader_->Read("reading what a standby has",
                       [&](SqlDatabase& database) -> absl::StatusOr<std::vector<StreamProgress>> {
                         return ReadReplicaProgress(database, id);
                       });
}

absl::Status SqlStore::WriteReplica(
    ReplicaKind kind, const std::string& id, bool anew,
    const std::function<absl::StatusOr<std::vector<ReplicaDigest>>(const TakeRows&)>& read) {
  return ChangeSessions(absl::StrCat("storing what the primary has", id.empty() ? "" : " of ", id),
                        [&](SqlDatabase& database) {
                          if (anew) EraseRecord(database, kind, id);
                          return WriteRecord(database, kind, id, read);
                        });
}

absl::Status SqlStore::EraseReplica(ReplicaKind kind, const std::string& id) {
  return Erase([&] {
    return ChangeSessions(absl::StrCat("deleting ", id), [&](SqlDatabase& database) {
      EraseRecord(database, kind, id);
      return absl::OkStatus();
    });
  });
}

absl::StatusOr<uint64_t> SqlStore::RaiseGeneration() {
  uint64_t generation = 0;
  RIGCAL_RETURN_IF_ERROR(
      writer_->Transact("taking over", [&](SqlDatabase& database) -> absl::Status {
        NextNumber(database, kGenerationCounter);
        generation = ReadGeneration(database);
        return absl::OkStatus();
      }));
  return generation;
}

}  // namespace rigcal::server
