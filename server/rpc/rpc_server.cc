// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/rpc_server.h"

#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/server_builder.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <thread>
#include <utility>

#include "common/status/status_macros.h"
#include "server/identity/generation_proof.h"
#include "server/rpc/api_calls.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/call_hooks.h"
#include "server/rpc/replication_service.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {
namespace {

constexpr std::chrono::milliseconds kLookInterval{2};
constexpr std::chrono::milliseconds kFarewell{100};
constexpr char kIngestService[] = "rigcal.v1.IngestService";
constexpr const char* kOtherServices[] = {
    "rigcal.v1.AgentService",   "rigcal.v1.CameraService",      "rigcal.v1.IdentityService",
    "rigcal.v1.SessionService", "rigcal.v1.CalibrationService", "rigcal.v1.LensService",
    "rigcal.v1.LiveService",    "rigcal.v1.MaintenanceService", "rigcal.v1.ReplicationService",
    "rigcal.v1.RigService",     "rigcal.v1.StatusService",      "rigcal.v1.TriangulationService"};

// Without a number: of a store that nobody follows.
DataGeneration GenerationOf(Store& store, const std::filesystem::path& identity_folder) {
  const ReplicaSource* const source = store.replica_source();
  DataGeneration generation{.identity_folder = identity_folder};
  if (source == nullptr) return generation;
  generation.number = source->Generation().value_or(0);
  auto proof = ProveGeneration(identity_folder, store.server_id(), generation.number);
  if (proof.ok()) {
    generation.proof = *std::move(proof);
  } else {
    spdlog::warn("agents get no proof of this server's generation: {}",
                 std::string(proof.status().message()));
  }
  return generation;
}

RpcEndpointOptions EndpointOptions(const RpcServerOptions& options, const Ingest* ingest) {
  RpcEndpointOptions result = options.endpoint;
  if (ingest != nullptr) {
    result.listener.waiting_bytes = [ingest] { return ingest->Stats().queue_bytes; };
  }
  return result;
}

}  // namespace

RpcServer::RpcServer(RpcServerOptions options, const RpcServerParts& parts)
    : options_(std::move(options)),
      parts_(parts),
      audit_(parts.audit == nullptr ? no_audit_ : *parts.audit),
      endpoint_(EndpointOptions(options_, parts.ingest), &audit_),
      previews_(options_.previews, parts.directory),
      detectors_(options_.detectors, parts.directory),
      choices_(options_.choices, parts.directory, parts.registry),
      readers_(options_.readers, parts.store, parts.coordinator),
      live_answers_(parts.live),
      ingest_service_(options_.agents, parts.coordinator, parts.ingest, &previews_, &detectors_,
                      &choices_, parts.store->server_id(), &endpoint_.security(), parts.registry,
                      parts.standbys,
                      GenerationOf(*parts.store, options_.endpoint.identity_folder)) {
  services_.push_back(MakeAgentService(parts, &choices_));
  services_.push_back(MakeCameraService(parts, &previews_, &detectors_, &choices_));
  services_.push_back(MakeIdentityService(parts));
  services_.push_back(MakeSessionService(parts, &watches_, &readers_));
  services_.push_back(MakeCalibrationService(parts, &watches_, &endpoint_.security()));
  services_.push_back(MakeRigService(parts, &endpoint_.security()));
  services_.push_back(MakeLensService(parts.store));
  services_.push_back(MakeLiveService(&live_answers_));
  services_.push_back(MakeMaintenanceService(parts.store, &watches_));
  if (parts.standbys != nullptr) {
    services_.push_back(MakeReplicationService(parts.store, parts.standbys, parts.data_dir));
  }
  services_.push_back(MakeStatusService(parts, options_.ingest_queue_limit_bytes, UtcNowNs({}),
                                        &endpoint_.listener(),
                                        options_.endpoint.listener.limits.total));
  services_.push_back(MakeTriangulationService(parts.store));
}

RpcServer::~RpcServer() { Shutdown(std::chrono::milliseconds(1000)); }

absl::StatusOr<int> RpcServer::Start() {
  grpc::ServerBuilder builder;
  RIGCAL_ASSIGN_OR_RETURN(const int port,
                          endpoint_.AddTo(&builder, options_.agents.max_message_bytes));
  std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> observers;
  observers.push_back(MakeCallObserver(&endpoint_.security()));
  builder.experimental().SetInterceptorCreators(std::move(observers));
  builder.RegisterService(&ingest_service_);
  for (const auto& service : services_) builder.RegisterService(service.get());
  server_ = builder.BuildAndStart();
  if (!server_) return absl::InternalError("gRPC cannot start; its log is ours at level debug");
  for (const char* service : kOtherServices) {
    server_->GetHealthCheckService()->SetServingStatus(service, true);
  }
  server_->GetHealthCheckService()->SetServingStatus(kIngestService, true);
  endpoint_.Accept();
  ReportHealth();
  health_.Start();
  return port;
}

void RpcServer::ReportHealth() {
  health_.PostAt(std::chrono::steady_clock::now() + options_.health_interval,
                 [this] { ReportHealth(); });
  endpoint_.FollowIdentity();
  const StoreHealth store = parts_.store->Health();
  std::string problem = store.problem;
  // A write of a session or a calibration can find that the disk has failed, before ingest does.
  const bool store_serves = problem.empty();
  if (store_serves_ && !store_serves) {
    for (const char* service : {"rigcal.v1.SessionService", "rigcal.v1.CalibrationService"}) {
      server_->GetHealthCheckService()->SetServingStatus(service, false);
    }
  }
  // What cannot be read stops no observations, but somebody must look.
  const bool hears = !endpoint_.listener().IsDeaf() && store.read_problem.empty();
  if ((hears && store_serves) != (hears_ && store_serves_)) {
    server_->GetHealthCheckService()->SetServingStatus("", hears && store_serves);
  }
  hears_ = hears;
  store_serves_ = store_serves;
  if (store_serves) problem = parts_.ingest->Stats().problem;
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
  endpoint_.Stop();
  if (!server_) return;
  server_->GetHealthCheckService()->SetServingStatus(false);
  previews_.Shutdown();
  detectors_.Shutdown();
  choices_.Shutdown();
  parts_.directory->CloseAll(
      absl::UnavailableError("the server is shutting down; connect again after a moment"));
  parts_.store->changes().Shutdown();
  watches_.EndStreams();
  readers_.EndStreams();
  const auto deadline = std::chrono::steady_clock::now() + grace;
  while (calls_in_flight > 0 && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(kLookInterval);
  }
  // gRPC waits for clients to close their connections, whether they are in a call or not; what is
  // left has been told why, and gets the time to hear it.
  server_->Shutdown(std::chrono::system_clock::now() + std::min(grace, kFarewell));
  endpoint_.StopPollers();
}

std::shared_ptr<grpc::Channel> RpcServer::InProcessChannel() {
  return server_->InProcessChannel(grpc::ChannelArguments());
}

std::unique_ptr<ApiGateway> RpcServer::MakeApiGateway() {
  return server::MakeApiGateway(InProcessChannel(), &endpoint_.security(), &live_answers_);
}

}  // namespace rigcal::server
