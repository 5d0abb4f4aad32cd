// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/generic/async_generic_service.h>
#include <grpcpp/server.h>

#include <memory>
#include <mutex>
#include <string>

#include "absl/status/statusor.h"
#include "server/rpc/rpc_endpoint.h"

namespace rigcal::server {

// Why a server answers nobody, and who does.
struct Refusal {
  std::string message;  // follows wire::kNotActive
  // HOST:PORT of the server to ask instead; empty: it is not known.
  std::string active_server;
};

// A gRPC server that refuses every call with UNAVAILABLE, its reason, and in the trailing metadata
// (wire::kActiveServerKey) the address of the server that answers; health says NOT_SERVING. For a
// server that waits for its turn, or follows another one. Thread-safe.
class RefusingServer {
 public:
  // `service`, where there is one, answers its calls; it must outlive this object.
  RefusingServer(RpcEndpointOptions options, AuditLog* audit, Refusal refusal,
                 grpc::Service* service = nullptr);
  ~RefusingServer() { Shutdown(); }

  // The port and errors of RpcEndpoint::AddTo.
  absl::StatusOr<int> Start();
  void SetRefusal(Refusal refusal);
  void Shutdown();
  // Call it every second or so.
  void FollowIdentity() { endpoint_.FollowIdentity(); }

 private:
  class Service final : public grpc::CallbackGenericService {
   public:
    explicit Service(RefusingServer* owner) : owner_(*owner) {}
    grpc::ServerGenericBidiReactor* CreateReactor(
        grpc::GenericCallbackServerContext* context) override;

   private:
    RefusingServer& owner_;
  };
  Refusal refusal() const;

  RpcEndpoint endpoint_;
  Service refusing_{this};
  grpc::Service* const service_;
  mutable std::mutex mutex_;
  Refusal refusal_;
  std::unique_ptr<grpc::Server> server_;
};

}  // namespace rigcal::server
