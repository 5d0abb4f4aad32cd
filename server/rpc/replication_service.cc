// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/replication_service.h"

#include <zlib.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <mutex>
#include <random>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/status/status_macros.h"
#include "common/wire/protocol_version.h"
#include "rigcal/v1/replication_service.grpc.pb.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/replica_messages.h"

namespace rigcal::server {
namespace {

constexpr uint32_t kLongestWaitMs = 5'000;
constexpr int kRowsInMessage = 4096;

// Of the data folder: who owns which camera, which rigs are monitored, whose certificates count.
// Keys are not among them.
constexpr const char* kFiles[] = {"agents.json", "monitors.json", "identity/identities.json",
                                  "identity/denied.json", "identity/ca.crt"};

std::string ContentOf(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

class ReplicationService final : public v1::ReplicationService::Service {
 public:
  ReplicationService(Store* store, StandbyBook* standbys, std::filesystem::path data_dir)
      : store_(*store), standbys_(*standbys), data_dir_(std::move(data_dir)) {}

  grpc::Status ListChanges(grpc::ServerContext* context, const v1::ListChangesRequest* request,
                           v1::ListChangesResponse* response) override {
    return GuardedCall("ListChanges", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(ReplicaSource* const source, CheckStandby(*request));
      const bool all = request->run_id() != store_.changes().run_id() || request->position() == 0;
      RIGCAL_RETURN_IF_ERROR(standbys_.NoteAsked(request->standby_id(), request->address(),
                                                 all ? 0 : request->position()));
      std::vector<StreamProgress> durable;
      for (const v1::StandbyPosition& position : request->durable()) {
        RIGCAL_ASSIGN_OR_RETURN(StreamProgress progress, ProgressOf(position));
        durable.push_back(std::move(progress));
      }
      standbys_.NoteDurable(durable);
      NoteFiles();
      const uint32_t wait_ms = all ? 0 : std::min(request->wait_ms(), kLongestWaitMs);
      const StoreChanges::Since since = store_.changes().WaitBeyond(
          all ? 0 : request->position(), std::chrono::milliseconds(wait_ms));
      if (context->IsCancelled()) return absl::CancelledError("the standby has left");
      RIGCAL_RETURN_IF_ERROR(Fill(*source, since, all, response));
      if (const auto state = standbys_.State()) response->set_behind_count(state->behind_rows);
      standbys_.NoteGiven(since.position, since.row_count);
      return absl::OkStatus();
    });
  }

  grpc::Status ReadRecord(grpc::ServerContext*, const v1::ReadRecordRequest* request,
                          grpc::ServerWriter<v1::ReadRecordResponse>* writer) override {
    return GuardedCall("ReadRecord", [&]() -> absl::Status {
      ReplicaSource* const source = store_.replica_source();
      if (source == nullptr) return NotFollowed();
      RIGCAL_ASSIGN_OR_RETURN(const ReplicaKind kind, KindOf(request->kind()));
      std::vector<ReplicaStream> streams;
      for (const v1::ReplicaStream& stream : request->streams()) {
        streams.push_back(StreamOf(stream));
      }
      RIGCAL_ASSIGN_OR_RETURN(
          const std::vector<ReplicaDigest> digests,
          source->ReadReplica(kind, request->id(), streams, [&](std::vector<ReplicaRows> part) {
            return Write(std::move(part), writer);
          }));
      if (kind == ReplicaKind::kShared) RIGCAL_RETURN_IF_ERROR(WriteFiles(writer));
      v1::ReadRecordResponse last;
      for (const ReplicaDigest& digest : digests) {
        v1::ReplicaDigest* const out = last.add_digests();
        out->set_table(digest.table);
        out->set_row_count(digest.row_count);
        out->set_digest(digest.digest);
      }
      if (!writer->Write(last)) return absl::CancelledError("the standby has left");
      return absl::OkStatus();
    });
  }

  grpc::Status Promote(grpc::ServerContext*, const v1::PromoteRequest*,
                       v1::PromoteResponse*) override {
    return GuardedCall("Promote", [] {
      return absl::FailedPreconditionError(
          "this server is no standby: it serves already, and nothing has changed");
    });
  }

  grpc::Status Supersede(grpc::ServerContext*, const v1::SupersedeRequest* request,
                         v1::SupersedeResponse* response) override {
    return GuardedCall("Supersede", [&]() -> absl::Status {
      ReplicaSource* const source = store_.replica_source();
      if (source == nullptr) return NotFollowed();
      RIGCAL_ASSIGN_OR_RETURN(const uint64_t generation, source->Generation());
      response->set_generation(generation);
      if (request->server_id() != store_.server_id()) {
        return absl::FailedPreconditionError("this server's data is of another server");
      }
      if (request->generation() <= generation) {
        return absl::FailedPreconditionError(
            absl::StrCat("this server has generation ", generation, ", and the one that says it ",
                         "has taken over has ", request->generation()));
      }
      standbys_.Supersede(request->generation(), request->address());
      return absl::OkStatus();
    });
  }

 private:
  static absl::Status NotFollowed() {
    return absl::UnimplementedError(
        "this server's data is in PostgreSQL, which has standbys of its own: other servers follow "
        "only a server with a database in its data folder");
  }

  absl::StatusOr<ReplicaSource*> CheckStandby(const v1::ListChangesRequest& request) {
    ReplicaSource* const source = store_.replica_source();
    if (source == nullptr) return NotFollowed();
    RIGCAL_RETURN_IF_ERROR(wire::CheckProtocolVersion(
        absl::StrCat("the standby at ", request.address()), request.protocol_version()));
    if (request.process_id() == ProcessId()) {
      return absl::FailedPreconditionError(
          "this server follows itself: --follow must name another server");
    }
    const uint32_t version = store_.Health().schema_version;
    if (request.schema_version() != version) {
      return absl::FailedPreconditionError(absl::StrCat(
          "the standby at ", request.address(), " (rigcal-server ", request.software_version(),
          ") has tables of version ", request.schema_version(), ", this server (",
          std::string(wire::kSoftwareVersion), ") of version ", version,
          ": install the same release on both"));
    }
    if (!request.server_id().empty() && request.server_id() != store_.server_id()) {
      return absl::FailedPreconditionError(absl::StrCat(
          "the data of the standby at ", request.address(), " is of another server (",
          request.server_id(), ", not ", store_.server_id(), "): start it with a new data folder"));
    }
    RIGCAL_ASSIGN_OR_RETURN(const uint64_t generation, source->Generation());
    if (request.generation() > generation) {
      return absl::FailedPreconditionError(
          absl::StrCat("the data of the standby at ", request.address(), " has generation ",
                       request.generation(), ", this server's has ", generation,
                       ": this one is the older of the two, and must follow that one"));
    }
    return source;
  }

  // The files are changed by others than the store.
  void NoteFiles() {
    uLong crc = 0;
    for (const char* name : kFiles) {
      const std::string content = ContentOf(data_dir_ / name);
      crc = crc32_z(crc, reinterpret_cast<const Bytef*>(content.data()), content.size());
    }
    const std::lock_guard lock(mutex_);
    if (std::exchange(files_crc_, crc) != crc) store_.changes().NoteShared();
  }

  absl::Status Fill(const ReplicaSource& source, const StoreChanges::Since& since, bool all,
                    v1::ListChangesResponse* response) {
    RIGCAL_ASSIGN_OR_RETURN(const uint64_t generation, source.Generation());
    response->set_server_id(store_.server_id());
    response->set_generation(generation);
    response->set_run_id(store_.changes().run_id());
    response->set_position(since.position);
    response->set_shared(all || since.shared);
    response->set_all(response->shared());
    if (!response->all()) {
      for (const std::string& id : since.sessions) response->add_sessions()->set_id(id);
      for (const std::string& id : since.calibrations) response->add_calibrations()->set_id(id);
      return absl::OkStatus();
    }
    RIGCAL_ASSIGN_OR_RETURN(const ReplicaListing listing, source.ListReplica());
    for (const ReplicaRecord& record : listing.sessions) {
      *response->add_sessions() = ToMessage(record);
    }
    for (const ReplicaRecord& record : listing.calibrations) {
      *response->add_calibrations() = ToMessage(record);
    }
    return absl::OkStatus();
  }

  static absl::Status Write(std::vector<ReplicaRows> part,
                            grpc::ServerWriter<v1::ReadRecordResponse>* writer) {
    for (ReplicaRows& rows : part) {
      auto begin = rows.rows.begin();
      do {
        const auto end = begin + std::min<std::ptrdiff_t>(kRowsInMessage, rows.rows.end() - begin);
        ReplicaRows some{.table = rows.table,
                         .rows = {std::make_move_iterator(begin), std::make_move_iterator(end)}};
        v1::ReadRecordResponse message = ToMessage(std::move(some));
        message.set_continues(begin != rows.rows.begin());
        if (!writer->Write(message)) return absl::CancelledError("the standby has left");
        begin = end;
      } while (begin != rows.rows.end());
    }
    return absl::OkStatus();
  }

  absl::Status WriteFiles(grpc::ServerWriter<v1::ReadRecordResponse>* writer) {
    for (const char* name : kFiles) {
      v1::ReadRecordResponse message;
      message.set_file(name);
      message.set_content(ContentOf(data_dir_ / name));
      if (message.content().empty()) continue;
      if (!writer->Write(message)) return absl::CancelledError("the standby has left");
    }
    return absl::OkStatus();
  }

  Store& store_;
  StandbyBook& standbys_;
  const std::filesystem::path data_dir_;
  std::mutex mutex_;
  uLong files_crc_ = 0;
};

}  // namespace

const std::string& ProcessId() {
  static const auto* const kId = new std::string([] {
    std::random_device device;
    return absl::StrFormat("%08x%08x", device(), device());
  }());
  return *kId;
}

std::unique_ptr<grpc::Service> MakeReplicationService(Store* store, StandbyBook* standbys,
                                                      std::filesystem::path data_dir) {
  return std::make_unique<ReplicationService>(store, standbys, std::move(data_dir));
}

}  // namespace rigcal::server
