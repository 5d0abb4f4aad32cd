// SPDX-License-Identifier: Apache-2.0
#include "client/net/server_connection.h"

#include <grpcpp/generic/generic_stub.h>

#include <algorithm>
#include <future>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/net/unknown_id.h"
#include "common/log/correlation_id.h"
#include "common/wire/grpc_status.h"
#include "grpc/health/v1/health.pb.h"

namespace rigcal::client {
namespace {

// A calibration of a large rig, or a session with thousands of refusals.
constexpr int kMaxMessageBytes = 64 << 20;
// How long one attempt may take, and the pause before the next.
constexpr int kConnectMs = 10'000;
constexpr int kConnectToOneOfManyMs = 2'000;
// A server that waits for its turn takes over from a silent one after 5 s.
constexpr std::chrono::milliseconds kTakeoverPatience{8'000};
constexpr std::chrono::milliseconds kTakeoverPause{300};
constexpr int kFirstPauseMs = 100;
constexpr int kLastPauseMs = 1000;
// Looked through for what an unknown id was meant to be.
constexpr uint32_t kMostKnownIds = 500;

std::shared_ptr<grpc::Channel> MakeChannel(
    const std::string& address, const std::shared_ptr<grpc::ChannelCredentials>& credentials,
    bool has_others) {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(kMaxMessageBytes);
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, kFirstPauseMs);
  // In spite of its name: the least time given to an attempt.
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS,
                   has_others ? kConnectToOneOfManyMs : kConnectMs);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, kLastPauseMs);
  // A name is looked up before each attempt; by default at most every 30 s, so that a server that
  // is back would not be found before.
  arguments.SetInt(GRPC_ARG_DNS_MIN_TIME_BETWEEN_RESOLUTIONS_MS, kLastPauseMs);
  const std::string target = address.starts_with("unix:") ? address : "dns:///" + address;
  return grpc::CreateCustomChannel(target, credentials, arguments);
}

// The library's messages go from the general to the cause: "failed to connect to all addresses;
// last error: UNKNOWN: ipv4:127.0.0.1:7420: Failed to connect to remote host: Connection refused".
std::string CauseOf(const std::string& message) {
  const size_t colon = message.rfind(": ");
  return colon == std::string::npos || colon + 2 >= message.size() ? message
                                                                   : message.substr(colon + 2);
}

// No server has got the call.
bool IsConnecting(const grpc::Status& status) {
  return absl::StrContains(absl::AsciiStrToLower(status.error_message()), "failed to connect");
}

// What the call itself was mistaken about needs no log.
bool IsLogged(absl::StatusCode code) {
  return code != absl::StatusCode::kNotFound && code != absl::StatusCode::kInvalidArgument &&
         code != absl::StatusCode::kAlreadyExists;
}

absl::Status WithCorrelation(const absl::Status& status) {
  return absl::Status(status.code(),
                      absl::StrCat(status.message(), " (correlation id ", OwnCorrelationId(), ")"));
}

constexpr char kAdvice[] =
    "Is rigcal-server running there? Another address is named with --server HOST:PORT or in the "
    "environment variable RIGCAL_SERVER";

}  // namespace

ServerConnection::ServerConnection(const std::string& servers, const wire::ClientIdentity& identity)
    : identity_(identity),
      // What is no address is not reached, and the first call says so.
      servers_(wire::ServerList::Parse(servers).value_or(wire::ServerList::Of(servers))),
      link_(MakeLink(servers_.current())) {}

std::shared_ptr<const ServerConnection::Link> ServerConnection::MakeLink(
    const std::string& address) const {
  auto credentials = wire::CredentialsFor(address, identity_);
  auto channel =
      MakeChannel(address, credentials.ok() ? *credentials : nullptr, servers_.size() > 1);
  return std::make_shared<const Link>(Link{address, std::move(credentials), std::move(channel)});
}

std::shared_ptr<const ServerConnection::Link> ServerConnection::link() const {
  const std::lock_guard lock(mutex_);
  return link_;
}

std::string ServerConnection::OtherRefusals(const Link& link) const {
  const std::lock_guard lock(mutex_);
  std::string text;
  for (const auto& [address, refusal] : refusals_) {
    if (address != link.address) {
      absl::StrAppend(&text, "\nthe server at ", address, ": ", refusal);
    }
  }
  return text;
}

void ServerConnection::Settle() {
  const std::lock_guard lock(mutex_);
  refusals_.clear();
  answered_.insert(link_->address);
  servers_.Settle();
}

bool ServerConnection::HasAnswered(const Link& link) const {
  const std::lock_guard lock(mutex_);
  return answered_.contains(link.address);
}

bool ServerConnection::MayAskAgain(const Link& link, const grpc::Status& status,
                                   const grpc::ClientContext& context,
                                   std::chrono::steady_clock::time_point begin) {
  const Next next = MoveOn(link, status, context);
  if (next != Next::kPause) return next == Next::kAsk;
  if (std::chrono::steady_clock::now() - begin > kTakeoverPatience) return false;
  std::this_thread::sleep_for(kTakeoverPause);
  return true;
}

ServerConnection::Next ServerConnection::MoveOn(const Link& link, const grpc::Status& status,
                                                const grpc::ClientContext& context) {
  if (status.error_code() != grpc::StatusCode::UNAVAILABLE &&
      status.error_code() != grpc::StatusCode::CANCELLED &&
      status.error_code() != grpc::StatusCode::DEADLINE_EXCEEDED) {
    return Next::kGiveUp;
  }
  const auto& trailing = context.GetServerTrailingMetadata();
  const auto named = trailing.find(wire::kActiveServerKey);
  const std::string active =
      named == trailing.end() ? "" : std::string(named->second.data(), named->second.length());
  const bool begun =
      !absl::StartsWith(status.error_message(), wire::kNotActive) && !IsConnecting(status);
  const std::lock_guard lock(mutex_);
  if (absl::StartsWith(status.error_message(), wire::kNotActive)) {
    refusals_[link.address] = status.error_message();
  }
  // Another thread has moved on already.
  if (link_.get() != &link) return begun ? Next::kGiveUp : Next::kAsk;
  bool next = servers_.MoveOn(active);
  auto moved = MakeLink(servers_.current());
  // A server that only the refusal has named, and that this user cannot ask: the refusal says more.
  if (servers_.current() == active && !moved->credentials.ok()) {
    next = servers_.MoveOn();
    moved = MakeLink(servers_.current());
  }
  link_ = std::move(moved);
  if (begun) return Next::kGiveUp;
  if (next) return Next::kAsk;
  const bool takes_over = std::ranges::any_of(refusals_, [](const auto& refusal) {
    return absl::StrContains(refusal.second, wire::kTakesOver);
  });
  return takes_over ? Next::kPause : Next::kGiveUp;
}

void ServerConnection::AddCorrelation(grpc::ClientContext* context) {
  context->AddMetadata(kCorrelationKey, OwnCorrelationId());
}

absl::Status ServerConnection::Explain(const Link& link, const grpc::Status& status,
                                       std::chrono::milliseconds timeout) const {
  const std::string cause = CauseOf(status.error_message());
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE &&
      absl::StrContains(status.error_message(), "http1.x")) {
    return absl::UnavailableError(
        absl::StrCat(link.address,
                     " is an HTTP port, such as that of the dashboard; rigcal speaks gRPC, "
                     "which is at the port before it (7420 where the dashboard is at 7421)"));
  }
  const bool plain = wire::IsOnThisMachine(link.address) && !link.address.starts_with("unix:") &&
                     !identity_.Exists();
  const bool closed =
      absl::StrContains(cause, "Socket closed") || absl::StrContains(cause, "reset by peer");
  // A server that wants a certificate closes a connection before it answers anything.
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE && closed &&
      (HasAnswered(link) || !IsConnecting(status))) {
    return absl::UnavailableError(
        absl::StrCat("the connection to the server at ", link.address, " was lost (", cause,
                     "): it has ended, starts again, or the network is cut; try again"));
  }
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE && plain && closed) {
    return absl::UnavailableError(absl::StrCat(
        "the server at ", link.address, " closes connections without a certificate (", cause,
        "). Where it is open to the network, only the user who runs it needs none, without "
        "--server; others join it: rigcal login STRING, with what `rigcal token create --role "
        "operator` prints for that user"));
  }
  // A waiting server says so itself, and one whose database is away names that.
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE &&
      (absl::StartsWith(status.error_message(), wire::kNotActive) ||
       absl::StrContains(status.error_message(), "postgresql://"))) {
    return absl::UnavailableError(
        absl::StrCat("the server at ", link.address, ": ", status.error_message()));
  }
  // Nobody here cancels a call: the server has ended.
  if (status.error_code() == grpc::StatusCode::CANCELLED) {
    return absl::UnavailableError(
        absl::StrCat("the server at ", link.address, " has ended, or was replaced; try again"));
  }
  if (const std::string others = OtherRefusals(link);
      status.error_code() == grpc::StatusCode::UNAVAILABLE && !others.empty()) {
    return absl::UnavailableError(absl::StrCat("no server answers:\nthe server at ", link.address,
                                               " cannot be reached (", cause, ")", others));
  }
  if (status.error_code() == grpc::StatusCode::UNAVAILABLE) {
    if (const absl::Status why = WhyRefused(link.address, identity_); !why.ok()) {
      return absl::Status(
          why.code(), absl::StrCat("the server at ", link.address, " does not let this user in (",
                                   cause, "):\n", std::string(why.message())));
    }
    return absl::UnavailableError(
        absl::StrCat("cannot reach the server at ", link.address, " (", cause, "). ", kAdvice,
                     wire::IsOnThisMachine(link.address) ? "" : ". rigcal doctor says more"));
  }
  if (status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED) {
    return absl::UnavailableError(
        absl::StrFormat("the server at %s did not answer within %.3g s. %s", link.address,
                        static_cast<double>(timeout.count()) / 1000, kAdvice));
  }
  if (status.error_code() == grpc::StatusCode::UNIMPLEMENTED) {
    return absl::UnimplementedError(absl::StrCat(
        "the server at ", link.address, " does not know this call (", status.error_message(),
        "): it is another program or another version; rigcal doctor compares the versions"));
  }
  const absl::Status named = wire::FromGrpc(status);
  if (absl::IsNotFound(named) && !named.message().empty()) return ExplainUnknownId(link, named);
  if (!named.message().empty()) return IsLogged(named.code()) ? WithCorrelation(named) : named;
  return WithCorrelation(absl::Status(
      named.code(), absl::StrCat("the server at ", link.address,
                                 " refused: ", absl::StatusCodeToString(named.code()))));
}

absl::Status ServerConnection::ExplainUnknownId(const Link& link,
                                                const absl::Status& status) const {
  const UnknownId unknown = ParseUnknownId(std::string(status.message()));
  if (unknown.kind.empty()) return status;
  KnownIds known;
  const auto deadline = std::chrono::system_clock::now() + kCallTimeout;
  {
    grpc::ClientContext context;
    context.set_deadline(deadline);
    v1::ListSessionsRequest request;
    request.set_page_size(kMostKnownIds);
    v1::ListSessionsResponse response;
    if (!v1::SessionService::Stub(link.channel).ListSessions(&context, request, &response).ok()) {
      return status;
    }
    for (const v1::Session& session : response.sessions()) known.sessions.push_back(session.id());
  }
  grpc::ClientContext context;
  context.set_deadline(deadline);
  v1::ListCalibrationsRequest request;
  request.set_page_size(kMostKnownIds);
  v1::ListCalibrationsResponse response;
  if (!v1::CalibrationService::Stub(link.channel)
           .ListCalibrations(&context, request, &response)
           .ok()) {
    return status;
  }
  for (const v1::Calibration& calibration : response.calibrations()) {
    known.calibrations.push_back(calibration.id());
  }
  return absl::NotFoundError(DescribeUnknownId(unknown, known));
}

absl::StatusOr<std::string> ServerConnection::CheckHealth() {
  const std::shared_ptr<const Link> link = this->link();
  if (!link->credentials.ok()) return link->credentials.status();
  using grpc::health::v1::HealthCheckRequest;
  using grpc::health::v1::HealthCheckResponse;
  grpc::TemplatedGenericStub<HealthCheckRequest, HealthCheckResponse> stub(link->channel);
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kCallTimeout);
  const HealthCheckRequest request;
  HealthCheckResponse response;
  // Shared: the callback's thread may still be inside set_value when get has returned.
  const auto done = std::make_shared<std::promise<grpc::Status>>();
  stub.UnaryCall(&context, "/grpc.health.v1.Health/Check", grpc::StubOptions(), &request, &response,
                 [done](grpc::Status status) { done->set_value(std::move(status)); });
  const grpc::Status status = done->get_future().get();
  if (!status.ok()) return Explain(*link, status, kCallTimeout);
  return HealthCheckResponse::ServingStatus_Name(response.status());
}

}  // namespace rigcal::client
