// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/refusing_server.h"

#include <grpcpp/health_check_service_interface.h>

#include <chrono>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/server_list.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxMessageBytes = size_t{4} << 20;
constexpr std::chrono::milliseconds kLastCalls{100};

// Refuses one call.
class RefusingReactor final : public grpc::ServerGenericBidiReactor {
 public:
  explicit RefusingReactor(const std::string& message) {
    Finish(grpc::Status(grpc::StatusCode::UNAVAILABLE, message));
  }
  void OnDone() override { delete this; }
};

}  // namespace

RefusingServer::RefusingServer(RpcEndpointOptions options, AuditLog* audit, Refusal refusal,
                               grpc::Service* service)
    : endpoint_(std::move(options), audit), service_(service), refusal_(std::move(refusal)) {}

grpc::ServerGenericBidiReactor* RefusingServer::Service::CreateReactor(
    grpc::GenericCallbackServerContext* context) {
  CallSecurity& security = owner_.endpoint_.security();
  security.EndCall(security.CallerOf(*context));
  const Refusal refusal = owner_.refusal();
  if (!refusal.active_server.empty()) {
    context->AddTrailingMetadata(wire::kActiveServerKey, refusal.active_server);
  }
  return new RefusingReactor(absl::StrCat(wire::kNotActive, ": ", refusal.message));
}

Refusal RefusingServer::refusal() const {
  const std::lock_guard lock(mutex_);
  return refusal_;
}

void RefusingServer::SetRefusal(Refusal refusal) {
  const std::lock_guard lock(mutex_);
  refusal_ = std::move(refusal);
}

absl::StatusOr<int> RefusingServer::Start() {
  grpc::ServerBuilder builder;
  RIGCAL_ASSIGN_OR_RETURN(const int port, endpoint_.AddTo(&builder, kMaxMessageBytes));
  if (service_ != nullptr) builder.RegisterService(service_);
  builder.RegisterCallbackGenericService(&refusing_);
  server_ = builder.BuildAndStart();
  if (!server_) return absl::InternalError("gRPC cannot start; its log is ours at level debug");
  server_->GetHealthCheckService()->SetServingStatus(false);
  endpoint_.Accept();
  return port;
}

void RefusingServer::Shutdown() {
  endpoint_.Stop();
  if (!server_) return;
  server_->Shutdown(std::chrono::system_clock::now() + kLastCalls);
  endpoint_.StopPollers();
  server_.reset();
}

}  // namespace rigcal::server
