// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/rpc_server.h"

#include <grpc/health/v1/health.pb.h>
#include <grpc/support/log.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/resource_quota.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server_builder.h>
#include <spdlog/spdlog.h>

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {
namespace {

constexpr char kIngestService[] = "rigcal.v1.IngestService";
constexpr const char* kOtherServices[] = {
    "rigcal.v1.AgentService", "rigcal.v1.CameraService", "rigcal.v1.SessionService",
    "rigcal.v1.CalibrationService", "rigcal.v1.StatusService"};

// Both plugins are global to the process and must be on before the first server is built; and so is
// the log of gRPC, which goes to ours at level debug: what matters of it comes back as a status,
// with our words.
void PrepareGrpc() {
  static const bool prepared = [] {
    gpr_set_log_function([](gpr_log_func_args* entry) {
      spdlog::debug("grpc: {}:{}: {}", entry->file, entry->line, entry->message);
    });
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
    // Reflection lists gRPC's own health service, which is made without this descriptor. The call
    // makes the linker keep it.
    return grpc::health::v1::HealthCheckRequest::descriptor() != nullptr;
  }();
  (void)prepared;
}

void SetLimits(const RpcServerOptions& options, grpc::ServerBuilder* builder) {
  grpc::ResourceQuota quota("rigcal");
  quota.Resize(options.memory_limit_bytes);
  quota.SetMaxThreads(options.max_threads);
  builder->SetResourceQuota(quota);
  builder->SetMaxReceiveMessageSize(static_cast<int>(options.agents.max_message_bytes));
  builder->SetSyncServerOption(grpc::ServerBuilder::SyncServerOption::NUM_CQS, 1);
  // Two servers on one port would both start and share the connections.
  builder->AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder->AddChannelArgument("grpc.server_handshake_timeout_ms", 5000);
  builder->AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, 128);
  // A connection without any traffic is asked for a sign of life, and closed without an answer.
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, 10'000);
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 5'000);
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder->AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  // Clients may ask for signs of life as well, idle ones too.
  builder->AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 1000);
}

}  // namespace

absl::Status CheckLoopback(const std::string& listen_address) {
  const size_t colon = listen_address.rfind(':');
  if (colon == std::string::npos || colon == 0 || colon + 1 == listen_address.size()) {
    return absl::InvalidArgumentError(absl::StrCat("the listen address '", listen_address,
                                                   "' is not HOST:PORT; an example is ",
                                                   "127.0.0.1:7420"));
  }
  const std::string host = listen_address.substr(0, colon);
  const bool four_bytes = host.find_first_not_of("0123456789.") == std::string::npos;
  if (host == "localhost" || host == "[::1]" || (four_bytes && host.rfind("127.", 0) == 0)) {
    return absl::OkStatus();
  }
  return absl::FailedPreconditionError(absl::StrCat(
      "the listen address '", listen_address, "' can be reached from other machines, and this ",
      "server has no certificates to tell friend from foe; listen on 127.0.0.1, and reach it from ",
      "elsewhere through ssh -L"));
}

RpcServer::RpcServer(RpcServerOptions options, const RpcServerParts& parts)
    : options_(std::move(options)),
      parts_(parts),
      previews_(options_.previews, parts.directory),
      ingest_service_(options_.agents, parts.coordinator, parts.ingest, &previews_,
                      parts.store->server_id()) {
  services_.push_back(MakeAgentService(parts));
  services_.push_back(MakeCameraService(&previews_));
  services_.push_back(MakeSessionService(parts, &watches_));
  services_.push_back(MakeCalibrationService(parts, &watches_));
  services_.push_back(MakeStatusService(parts, options_.ingest_queue_limit_bytes, UtcNowNs({})));
}

RpcServer::~RpcServer() { Shutdown(std::chrono::milliseconds(1000)); }

absl::StatusOr<int> RpcServer::Start() {
  if (!options_.listen_address.empty()) {
    RIGCAL_RETURN_IF_ERROR(CheckLoopback(options_.listen_address));
  }
  if (options_.memory_limit_bytes < options_.agents.max_message_bytes) {
    return absl::InvalidArgumentError(
        absl::StrCat("the memory for messages is ", options_.memory_limit_bytes >> 20,
                     " MiB, which does not ", "hold one message of ",
                     options_.agents.max_message_bytes >> 20, " MiB; raise limits.rpc_memory_mb"));
  }
  PrepareGrpc();
  grpc::ServerBuilder builder;
  SetLimits(options_, &builder);
  int port = 0;
  if (!options_.listen_address.empty()) {
    builder.AddListeningPort(options_.listen_address, grpc::InsecureServerCredentials(), &port);
  }
  builder.RegisterService(&ingest_service_);
  for (const auto& service : services_) builder.RegisterService(service.get());
  server_ = builder.BuildAndStart();
  if (!server_ || (!options_.listen_address.empty() && port == 0)) {
    server_.reset();
    return absl::UnavailableError(absl::StrCat(
        "cannot listen on ", options_.listen_address, ": the port is in use (by another ",
        "rigcal-server?) or not allowed; stop the other program, or choose another port with ",
        "--listen (port 0 takes any free one)"));
  }
  for (const char* service : kOtherServices) {
    server_->GetHealthCheckService()->SetServingStatus(service, true);
  }
  server_->GetHealthCheckService()->SetServingStatus(kIngestService, true);
  ReportHealth();
  health_.Start();
  return port;
}

void RpcServer::ReportHealth() {
  health_.PostAt(std::chrono::steady_clock::now() + options_.health_interval,
                 [this] { ReportHealth(); });
  const std::string problem = parts_.ingest->Stats().problem;
  if (problem.empty() == ingest_serves_) return;
  ingest_serves_ = problem.empty();
  server_->GetHealthCheckService()->SetServingStatus(kIngestService, ingest_serves_);
  if (ingest_serves_) {
    spdlog::info("ingest takes observations again");
  } else {
    spdlog::error("ingest takes no observations: {}", problem);
  }
}

void RpcServer::Shutdown(std::chrono::milliseconds grace) {
  if (std::exchange(stopping_, true)) return;
  health_.Shutdown();
  if (!server_) return;
  server_->GetHealthCheckService()->SetServingStatus(false);
  previews_.Shutdown();
  parts_.directory->CloseAll(
      absl::UnavailableError("the server is shutting down; connect again after a moment"));
  watches_.EndStreams();
  server_->Shutdown(std::chrono::system_clock::now() + grace);
}

std::shared_ptr<grpc::Channel> RpcServer::InProcessChannel() {
  return server_->InProcessChannel(grpc::ChannelArguments());
}

}  // namespace rigcal::server
