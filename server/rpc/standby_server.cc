// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/standby_server.h"

#include <utility>

#include "common/status/status_macros.h"
#include "rigcal/v1/replication_service.grpc.pb.h"
#include "server/audit/audit_log.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/refusing_server.h"
#include "server/rpc/replication_service.h"

namespace rigcal::server {
namespace {

class StandbyService final : public v1::ReplicationService::Service {
 public:
  explicit StandbyService(const StandbyServerOptions* options) : options_(*options) {}

  grpc::Status ListChanges(grpc::ServerContext*, const v1::ListChangesRequest* request,
                           v1::ListChangesResponse*) override {
    if (request->process_id() == ProcessId()) {
      return {grpc::StatusCode::FAILED_PRECONDITION,
              "this server follows itself: --follow must name another server"};
    }
    return {grpc::StatusCode::FAILED_PRECONDITION,
            options_.reason + "; a standby follows only a server that serves"};
  }
  grpc::Status ReadRecord(grpc::ServerContext*, const v1::ReadRecordRequest*,
                          grpc::ServerWriter<v1::ReadRecordResponse>*) override {
    return {grpc::StatusCode::UNAVAILABLE, options_.reason};
  }
  grpc::Status Supersede(grpc::ServerContext*, const v1::SupersedeRequest*,
                         v1::SupersedeResponse*) override {
    return {grpc::StatusCode::UNAVAILABLE, options_.reason};
  }
  grpc::Status Promote(grpc::ServerContext*, const v1::PromoteRequest* request,
                       v1::PromoteResponse* response) override {
    return GuardedCall("Promote", [&]() -> absl::Status {
      if (!options_.promote) return absl::FailedPreconditionError(options_.reason);
      RIGCAL_ASSIGN_OR_RETURN(const Promotion promotion, options_.promote(request->force()));
      response->set_generation(promotion.generation);
      response->set_primary(promotion.primary);
      response->set_silence_s(promotion.silence_s);
      response->set_missing_count(promotion.missing_count);
      return absl::OkStatus();
    });
  }

 private:
  const StandbyServerOptions& options_;
};

}  // namespace

class StandbyServer::Impl {
 public:
  explicit Impl(StandbyServerOptions options) : options_(std::move(options)) {}
  absl::StatusOr<int> Start() { return refusing_.Start(); }
  void Shutdown() { refusing_.Shutdown(); }

 private:
  const StandbyServerOptions options_;
  AuditLog audit_{""};
  StandbyService service_{&options_};
  RefusingServer refusing_{
      options_.endpoint,
      &audit_,
      {.message = options_.reason, .active_server = options_.active_server},
      &service_};
};

StandbyServer::StandbyServer(StandbyServerOptions options)
    : impl_(std::make_unique<Impl>(std::move(options))) {}

StandbyServer::~StandbyServer() { impl_->Shutdown(); }

absl::StatusOr<int> StandbyServer::Start() { return impl_->Start(); }

void StandbyServer::Shutdown() { impl_->Shutdown(); }

}  // namespace rigcal::server
