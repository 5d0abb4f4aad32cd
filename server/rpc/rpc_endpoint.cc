// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/rpc_endpoint.h"

#include <grpc/health/v1/health.pb.h>
#include <grpc/support/log.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/resource_quota.h>
#include <grpcpp/security/server_credentials.h>
#include <spdlog/spdlog.h>

#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/listen/listen_socket.h"
#include "server/rpc/call_hooks.h"

namespace rigcal::server {
namespace {

constexpr int kMaxReadBytes = 256 << 10;

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

void SetLimits(const RpcEndpointOptions& options, size_t max_message_bytes,
               grpc::ServerBuilder* builder) {
  grpc::ResourceQuota quota("rigcal");
  quota.Resize(options.memory_limit_bytes);
  quota.SetMaxThreads(options.max_threads);
  builder->SetResourceQuota(quota);
  // Nobody here compresses, and what 4 KB become is nobody's to count.
  builder->SetCompressionAlgorithmSupportStatus(GRPC_COMPRESS_DEFLATE, false);
  builder->SetCompressionAlgorithmSupportStatus(GRPC_COMPRESS_GZIP, false);
  builder->SetMaxReceiveMessageSize(static_cast<int>(max_message_bytes));
  builder->SetSyncServerOption(grpc::ServerBuilder::SyncServerOption::NUM_CQS, 1);
  // Two servers on one port would both start and share the connections.
  builder->AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder->AddChannelArgument("grpc.server_handshake_timeout_ms", 5000);
  // gRPC parses what it has read in one go, and begins every call in it before anything else sees
  // them: 4 MB, its own limit, hold 35 000 calls of 11 KB each.
  builder->AddChannelArgument(GRPC_ARG_TCP_MAX_READ_CHUNK_SIZE, kMaxReadBytes);
  builder->AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, 128);
  // On a fast link gRPC would let the window of each stream grow to megabytes, while the server is
  // busy with those of others.
  builder->AddChannelArgument(GRPC_ARG_HTTP2_BDP_PROBE, 0);
  builder->AddChannelArgument(GRPC_ARG_HTTP2_STREAM_LOOKAHEAD_BYTES,
                              static_cast<int>(options.listener.floods.window_bytes));
  // A connection without any traffic is asked for a sign of life, and closed without an answer.
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, 10'000);
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 5'000);
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder->AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  // Clients may ask for signs of life as well, idle ones too.
  builder->AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 1000);
}

absl::StatusOr<std::unique_ptr<CheckedIdentity>> LoadIdentity(const RpcEndpointOptions& options) {
  if (options.identity_folder.empty()) return nullptr;
  return CheckedIdentity::Load(options.identity_folder);
}

ListenerOptions ListeningOptions(const RpcEndpointOptions& options, Pollers* pollers) {
  ListenerOptions result = options.listener;
  result.on_stall = [pollers] { pollers->Help(); };
  result.readers = Pollers::OwnThreadsOfGrpc();
  result.address = options.listen_address;
  result.socket_file = options.socket_file;
  result.tls = !options.identity_folder.empty();
  return result;
}

}  // namespace

RpcEndpoint::RpcEndpoint(RpcEndpointOptions options, AuditLog* audit)
    : options_(std::move(options)),
      audit_(*audit),
      identity_(LoadIdentity(options_)),
      accepted_(options_.identity_folder),
      listener_(ListeningOptions(options_, &pollers_), &audit_, &conduct_),
      security_(identity_.ok() ? identity_->get() : nullptr, &accepted_, &listener_.connections(),
                &conduct_, &audit_) {}

absl::StatusOr<int> RpcEndpoint::AddTo(grpc::ServerBuilder* builder, size_t max_message_bytes) {
  RIGCAL_RETURN_IF_ERROR(identity_.status());
  const std::string& address = options_.listen_address;
  if (!address.empty()) RIGCAL_RETURN_IF_ERROR(ParseHostPort(address).status());
  if (!address.empty() && !IsLoopbackAddress(address) && !security_.has_certificates()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the listen address '", address, "' can be reached from other machines, and this server ",
        "has no certificates to tell friend from foe; listen on 127.0.0.1"));
  }
  if (options_.memory_limit_bytes < max_message_bytes) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the memory for messages is ", options_.memory_limit_bytes >> 20, " MiB, which does not ",
        "hold one message of ", max_message_bytes >> 20, " MiB; raise limits.rpc_memory_mb"));
  }
  PrepareGrpc();
  SetLimits(options_, max_message_bytes, builder);
  RIGCAL_ASSIGN_OR_RETURN(const int port, listener_.Bind());
  using Type = grpc::ServerBuilder::experimental_type::ExternalConnectionType;
  plain_ = builder->experimental().AddExternalConnectionAcceptor(Type::FROM_FD,
                                                                 grpc::InsecureServerCredentials());
  if (security_.has_certificates()) {
    tls_ = builder->experimental().AddExternalConnectionAcceptor(
        Type::FROM_FD, MakeTlsCredentials(**identity_, &security_));
  }
  pollers_.AddTo(builder);
  return port;
}

void RpcEndpoint::Accept() {
  pollers_.Start();
  listener_.Start([this](Listener::Kind kind, int descriptor) {
    grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters connection;
    connection.fd = descriptor;
    (kind == Listener::Kind::kTls ? tls_ : plain_)->HandleNewConnection(&connection);
  });
}

void RpcEndpoint::FollowIdentity() {
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

}  // namespace rigcal::server
