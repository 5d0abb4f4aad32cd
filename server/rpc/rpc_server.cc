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

#include <algorithm>
#include <thread>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/listen/listen_socket.h"
#include "server/rpc/api_calls.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/call_hooks.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {
namespace {

constexpr std::chrono::milliseconds kLookInterval{2};
constexpr std::chrono::milliseconds kFarewell{100};
constexpr int kMaxReadBytes = 256 << 10;
constexpr char kIngestService[] = "rigcal.v1.IngestService";
constexpr const char* kOtherServices[] = {
    "rigcal.v1.AgentService",   "rigcal.v1.CameraService",       "rigcal.v1.IdentityService",
    "rigcal.v1.SessionService", "rigcal.v1.CalibrationService",  "rigcal.v1.LensService",
    "rigcal.v1.LiveService",    "rigcal.v1.MaintenanceService",  "rigcal.v1.RigService",
    "rigcal.v1.StatusService",  "rigcal.v1.TriangulationService"};

// Both plugins are global to the process and must be on before the first server is built; and so is
// the log of gRPC, which goes to ours at level debug: what matters of it comes back as a status,
// with our words. Only why gRPC ends the process does not.
void PrepareGrpc() {
  static const bool prepared = [] {
    gpr_set_log_function([](gpr_log_func_args* entry) {
      const bool fatal = absl::StartsWith(entry->message, "assertion failed");
      spdlog::log(fatal ? spdlog::level::critical : spdlog::level::debug, "grpc: {}:{}: {}",
                  entry->file, entry->line, entry->message);
      if (fatal) spdlog::default_logger_raw()->flush();
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
  // Nobody here compresses, and what 4 KB become is nobody's to count.
  builder->SetCompressionAlgorithmSupportStatus(GRPC_COMPRESS_DEFLATE, false);
  builder->SetCompressionAlgorithmSupportStatus(GRPC_COMPRESS_GZIP, false);
  builder->SetMaxReceiveMessageSize(static_cast<int>(options.agents.max_message_bytes));
  builder->SetSyncServerOption(grpc::ServerBuilder::SyncServerOption::NUM_CQS, 1);
  // Two servers on one port would both start and share the connections.
  builder->AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder->AddChannelArgument("grpc.server_handshake_timeout_ms", 5000);
  // gRPC parses what it has read in one go, and begins every call in it before anything else sees
  // them: 4 MB, its own limit, hold 35 000 calls of 11 KB each.
  builder->AddChannelArgument(GRPC_ARG_TCP_MAX_READ_CHUNK_SIZE, kMaxReadBytes);
  builder->AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, 128);
  // A connection without any traffic is asked for a sign of life, and closed without an answer.
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, 10'000);
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 5'000);
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder->AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  // Clients may ask for signs of life as well, idle ones too.
  builder->AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 1000);
}

absl::StatusOr<std::unique_ptr<CheckedIdentity>> LoadIdentity(const RpcServerOptions& options) {
  if (options.identity_folder.empty()) return nullptr;
  return CheckedIdentity::Load(options.identity_folder);
}

ListenerOptions ListeningOptions(const RpcServerOptions& options) {
  ListenerOptions result = options.listener;
  result.address = options.listen_address;
  result.socket_file = options.socket_file;
  result.tls = !options.identity_folder.empty();
  return result;
}

}  // namespace

RpcServer::RpcServer(RpcServerOptions options, const RpcServerParts& parts)
    : options_(std::move(options)),
      parts_(parts),
      audit_(parts.audit == nullptr ? no_audit_ : *parts.audit),
      identity_(LoadIdentity(options_)),
      accepted_(options_.identity_folder),
      listener_(ListeningOptions(options_), &audit_, &conduct_),
      security_(identity_.ok() ? identity_->get() : nullptr, &accepted_, &listener_.connections(),
                &conduct_, &audit_),
      previews_(options_.previews, parts.directory),
      detectors_(options_.detectors, parts.directory),
      choices_(options_.choices, parts.directory, parts.registry),
      readers_(options_.readers, parts.store, parts.coordinator),
      live_answers_(parts.live),
      ingest_service_(options_.agents, parts.coordinator, parts.ingest, &previews_, &detectors_,
                      &choices_, parts.store->server_id(), &security_, parts.registry) {
  services_.push_back(MakeAgentService(parts, &choices_));
  services_.push_back(MakeCameraService(parts, &previews_, &detectors_, &choices_));
  services_.push_back(MakeIdentityService(parts));
  services_.push_back(MakeSessionService(parts, &watches_, &readers_));
  services_.push_back(MakeCalibrationService(parts, &watches_, &security_));
  services_.push_back(MakeRigService(parts, &security_));
  services_.push_back(MakeLensService(parts.store));
  services_.push_back(MakeLiveService(&live_answers_));
  services_.push_back(MakeMaintenanceService(parts.store, &watches_));
  services_.push_back(MakeStatusService(parts, options_.ingest_queue_limit_bytes, UtcNowNs({}),
                                        &listener_, options_.listener.limits.total));
  services_.push_back(MakeTriangulationService(parts.store));
}

RpcServer::~RpcServer() { Shutdown(std::chrono::milliseconds(1000)); }

absl::StatusOr<int> RpcServer::Start() {
  RIGCAL_RETURN_IF_ERROR(identity_.status());
  const std::string& address = options_.listen_address;
  if (!address.empty()) RIGCAL_RETURN_IF_ERROR(ParseHostPort(address).status());
  if (!address.empty() && !IsLoopbackAddress(address) && !security_.has_certificates()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the listen address '", address, "' can be reached from other machines, and this server ",
        "has no certificates to tell friend from foe; listen on 127.0.0.1"));
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
  RIGCAL_ASSIGN_OR_RETURN(const int port, listener_.Bind());
  using Type = grpc::ServerBuilder::experimental_type::ExternalConnectionType;
  plain_ = builder.experimental().AddExternalConnectionAcceptor(Type::FROM_FD,
                                                                grpc::InsecureServerCredentials());
  if (security_.has_certificates()) {
    tls_ = builder.experimental().AddExternalConnectionAcceptor(
        Type::FROM_FD, MakeTlsCredentials(**identity_, &security_));
  }
  std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> observers;
  observers.push_back(MakeCallObserver(&security_));
  builder.experimental().SetInterceptorCreators(std::move(observers));
  builder.RegisterService(&ingest_service_);
  for (const auto& service : services_) builder.RegisterService(service.get());
  pollers_.AddTo(&builder);
  server_ = builder.BuildAndStart();
  if (!server_) return absl::InternalError("gRPC cannot start; its log is ours at level debug");
  pollers_.Start();
  for (const char* service : kOtherServices) {
    server_->GetHealthCheckService()->SetServingStatus(service, true);
  }
  server_->GetHealthCheckService()->SetServingStatus(kIngestService, true);
  Accept();
  ReportHealth();
  health_.Start();
  return port;
}

void RpcServer::Accept() {
  listener_.Start([this](Listener::Kind kind, int descriptor) {
    grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters connection;
    connection.fd = descriptor;
    (kind == Listener::Kind::kTls ? tls_ : plain_)->HandleNewConnection(&connection);
  });
}

void RpcServer::FollowIdentity() {
  if (!security_.has_certificates()) return;
  (*identity_)->Refresh();
  std::vector<std::string> reasons;
  const std::vector<Peer> cut = listener_.connections().CutIf([&](const Peer& peer) {
    std::string reason = security_.WhyToCut(peer);
    if (reason.empty()) return false;
    reasons.push_back(std::move(reason));
    return true;
  });
  for (size_t i = 0; i < cut.size(); ++i) {
    spdlog::warn("the connection of {} is cut: {}", Describe(cut[i]), reasons[i]);
    audit_.Write("connection_cut", Describe(cut[i]), {{"reason", reasons[i]}});
  }
}

void RpcServer::ReportHealth() {
  health_.PostAt(std::chrono::steady_clock::now() + options_.health_interval,
                 [this] { ReportHealth(); });
  FollowIdentity();
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
  const bool hears = !listener_.IsDeaf() && store.read_problem.empty();
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
  listener_.Stop();
  if (!server_) return;
  server_->GetHealthCheckService()->SetServingStatus(false);
  previews_.Shutdown();
  detectors_.Shutdown();
  choices_.Shutdown();
  parts_.directory->CloseAll(
      absl::UnavailableError("the server is shutting down; connect again after a moment"));
  watches_.EndStreams();
  readers_.EndStreams();
  const auto deadline = std::chrono::steady_clock::now() + grace;
  while (calls_in_flight > 0 && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(kLookInterval);
  }
  // gRPC waits for clients to close their connections, whether they are in a call or not; what is
  // left has been told why, and gets the time to hear it.
  server_->Shutdown(std::chrono::system_clock::now() + std::min(grace, kFarewell));
  pollers_.Shutdown();
}

std::shared_ptr<grpc::Channel> RpcServer::InProcessChannel() {
  return server_->InProcessChannel(grpc::ChannelArguments());
}

std::unique_ptr<ApiGateway> RpcServer::MakeApiGateway() {
  return server::MakeApiGateway(InProcessChannel(), &security_, &live_answers_);
}

}  // namespace rigcal::server
