// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rigcal/v1/session_service.grpc.pb.h"
#include "server/rpc/watch_hub.h"
#include "server/session/session_coordinator.h"
#include "server/store/store.h"

namespace rigcal::server {

// rigcal.v1.SessionService.
class SessionService final
    : public v1::SessionService::WithCallbackMethod_WatchSession<v1::SessionService::Service> {
 public:
  SessionService(SessionCoordinator* coordinator, Store* store, WatchHub* watches)
      : coordinator_(*coordinator), store_(*store), watches_(*watches) {}

  grpc::Status CreateSession(grpc::ServerContext* context, const v1::CreateSessionRequest* request,
                             v1::CreateSessionResponse* response) override;
  grpc::Status StartSession(grpc::ServerContext* context, const v1::StartSessionRequest* request,
                            v1::StartSessionResponse* response) override;
  grpc::Status StopSession(grpc::ServerContext* context, const v1::StopSessionRequest* request,
                           v1::StopSessionResponse* response) override;
  grpc::Status GetSession(grpc::ServerContext* context, const v1::GetSessionRequest* request,
                          v1::GetSessionResponse* response) override;
  grpc::Status ListSessions(grpc::ServerContext* context, const v1::ListSessionsRequest* request,
                            v1::ListSessionsResponse* response) override;
  grpc::Status DeleteSession(grpc::ServerContext* context, const v1::DeleteSessionRequest* request,
                             v1::DeleteSessionResponse* response) override;
  grpc::ServerWriteReactor<v1::WatchSessionResponse>* WatchSession(
      grpc::CallbackServerContext* context, const v1::WatchSessionRequest* request) override;
  grpc::Status ReadObservations(grpc::ServerContext* context,
                                const v1::ReadObservationsRequest* request,
                                grpc::ServerWriter<v1::ReadObservationsResponse>* writer) override;

 private:
  absl::Status Describe(absl::StatusOr<Session> session, v1::Session* response) const;

  SessionCoordinator& coordinator_;
  Store& store_;
  WatchHub& watches_;
};

}  // namespace rigcal::server
