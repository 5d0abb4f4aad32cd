// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/replication_client.h"

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>

#include <chrono>
#include <mutex>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/grpc_status.h"
#include "common/wire/protocol_version.h"
#include "common/wire/server_access.h"
#include "rigcal/v1/replication_service.grpc.pb.h"
#include "server/rpc/replica_messages.h"

namespace rigcal::server {
namespace {

constexpr std::chrono::seconds kShortCall{3};
constexpr std::chrono::seconds kListCall{15};
// A record may be gigabytes.
constexpr std::chrono::minutes kReadCall{30};

class GrpcPrimaryLink final : public PrimaryLink {
 public:
  GrpcPrimaryLink(std::string address, const std::shared_ptr<grpc::Channel>& channel)
      : address_(std::move(address)), stub_(v1::ReplicationService::NewStub(channel)) {}

  absl::StatusOr<ChangesAnswer> ListChanges(const ChangesQuestion& question) override {
    v1::ListChangesRequest request;
    *request.mutable_protocol_version() = wire::OwnProtocolVersion();
    request.set_software_version(std::string(wire::kSoftwareVersion));
    request.set_schema_version(question.schema_version);
    request.set_standby_id(question.standby_id);
    request.set_process_id(question.process_id);
    request.set_server_id(question.server_id);
    request.set_generation(question.generation);
    request.set_position(question.position);
    request.set_run_id(question.run_id);
    request.set_wait_ms(question.wait_ms);
    request.set_address(question.address);
    for (const StreamProgress& progress : question.durable) {
      *request.add_durable() = ToMessage(progress);
    }
    v1::ListChangesResponse response;
    Call call(this, kListCall);
    RIGCAL_RETURN_IF_ERROR(Named(stub_->ListChanges(&call.context, request, &response)));
    ChangesAnswer answer{.server_id = response.server_id(),
                         .generation = response.generation(),
                         .run_id = response.run_id(),
                         .position = response.position(),
                         .all = response.all(),
                         .shared = response.shared(),
                         .sessions = {},
                         .calibrations = {},
                         .behind_count = response.behind_count()};
    for (const v1::ReplicaRecord& record : response.sessions()) {
      RIGCAL_ASSIGN_OR_RETURN(ReplicaRecord session, RecordOf(record));
      answer.sessions.push_back(std::move(session));
    }
    for (const v1::ReplicaRecord& record : response.calibrations()) {
      RIGCAL_ASSIGN_OR_RETURN(ReplicaRecord calibration, RecordOf(record));
      answer.calibrations.push_back(std::move(calibration));
    }
    return answer;
  }

  absl::StatusOr<std::vector<ReplicaDigest>> ReadRecord(
      ReplicaKind kind, const std::string& id, const std::vector<ReplicaStream>& streams,
      const ReplicaTarget::TakeRows& take,
      const std::function<absl::Status(const std::string&, const std::string&)>& take_file)
      override {
    v1::ReadRecordRequest request;
    request.set_kind(ToMessage(kind));
    request.set_id(id);
    for (const ReplicaStream& stream : streams) *request.add_streams() = ToMessage(stream);
    Call call(this, kReadCall);
    const auto reader = stub_->ReadRecord(&call.context, request);
    std::vector<ReplicaDigest> digests;
    absl::Status taken;
    v1::ReadRecordResponse message;
    while (taken.ok() && reader->Read(&message)) {
      if (!message.file().empty()) {
        taken = take_file(message.file(), message.content());
      } else if (!message.table().empty()) {
        absl::StatusOr<ReplicaRows> rows = RowsOf(std::move(message));
        taken = rows.status();
        if (rows.ok()) {
          std::vector<ReplicaRows> part;
          part.push_back(*std::move(rows));
          taken = take(std::move(part));
        }
      } else {
        for (const v1::ReplicaDigest& digest : message.digests()) {
          digests.push_back({digest.table(), digest.row_count(), digest.digest()});
        }
      }
      message.Clear();
    }
    if (!taken.ok()) {
      call.context.TryCancel();
      reader->Finish();
      return taken;
    }
    RIGCAL_RETURN_IF_ERROR(Named(reader->Finish()));
    return digests;
  }

  bool Answers() override {
    // A question that it must refuse: only who serves says so.
    Call call(this, kShortCall);
    v1::SupersedeResponse response;
    const absl::Status status = wire::FromGrpc(stub_->Supersede(&call.context, {}, &response));
    return absl::IsFailedPrecondition(status) || absl::IsPermissionDenied(status);
  }

  absl::Status Supersede(const std::string& server_id, uint64_t generation,
                         const std::string& own_address) override {
    Call call(this, kShortCall);
    v1::SupersedeRequest request;
    request.set_server_id(server_id);
    request.set_generation(generation);
    request.set_address(own_address);
    v1::SupersedeResponse response;
    return Named(stub_->Supersede(&call.context, request, &response));
  }

  void Cancel() override {
    const std::lock_guard lock(mutex_);
    cancelled_ = true;
    for (grpc::ClientContext* context : contexts_) context->TryCancel();
  }

 private:
  struct Call {
    Call(GrpcPrimaryLink* link, std::chrono::system_clock::duration limit) : link_(*link) {
      context.set_deadline(std::chrono::system_clock::now() + limit);
      const std::lock_guard lock(link_.mutex_);
      link_.contexts_.insert(&context);
      if (link_.cancelled_) context.TryCancel();
    }
    ~Call() {
      const std::lock_guard lock(link_.mutex_);
      link_.contexts_.erase(&context);
    }
    Call(const Call&) = delete;
    Call& operator=(const Call&) = delete;

    grpc::ClientContext context;

   private:
    GrpcPrimaryLink& link_;
  };

  absl::Status Named(const grpc::Status& grpc_status) const {
    const absl::Status status = wire::FromGrpc(grpc_status);
    if (status.ok()) return status;
    return absl::Status(status.code(), absl::StrCat("primary ", address_, ": ", status.message()));
  }

  const std::string address_;
  const std::unique_ptr<v1::ReplicationService::Stub> stub_;
  std::mutex mutex_;
  bool cancelled_ = false;
  std::set<grpc::ClientContext*> contexts_;
};

std::shared_ptr<grpc::Channel> MakeChannel(
    const std::string& address, const std::shared_ptr<grpc::ChannelCredentials>& credentials) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 200);
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 1'000);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2'000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 5'000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 5'000);
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  arguments.SetMaxReceiveMessageSize(-1);
  return grpc::CreateCustomChannel(address, credentials, arguments);
}

}  // namespace

absl::StatusOr<std::unique_ptr<PrimaryLink>> LinkToPrimary(const std::string& address) {
  RIGCAL_ASSIGN_OR_RETURN(const auto credentials,
                          wire::CredentialsFor(address, wire::ClientIdentity::OfUser()));
  return std::make_unique<GrpcPrimaryLink>(address, MakeChannel(address, credentials));
}

absl::StatusOr<Promotion> PromoteRunningServer(const std::string& address, bool force) {
  const auto stub =
      v1::ReplicationService::NewStub(MakeChannel(address, grpc::InsecureChannelCredentials()));
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
  v1::PromoteRequest request;
  request.set_force(force);
  v1::PromoteResponse response;
  RIGCAL_RETURN_IF_ERROR(wire::FromGrpc(stub->Promote(&context, request, &response)));
  return Promotion{.generation = response.generation(),
                   .primary = response.primary(),
                   .silence_s = response.silence_s(),
                   .missing_count = response.missing_count()};
}

}  // namespace rigcal::server
