// SPDX-License-Identifier: Apache-2.0
#include "agent/uplink/uplink.h"

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <random>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/uplink/host_alignment.h"
#include "agent/uplink/uplink_connection.h"
#include "common/camera/camera_id.h"
#include "common/status/fault_list.h"
#include "common/status/status_macros.h"
#include "common/wire/camera_wire.h"
#include "common/wire/observation_wire.h"
#include "common/wire/preview_wire.h"
#include "common/wire/protocol_version.h"

namespace rigcal::agent {
namespace {

// A connection that stood for so long was good even if nothing had to be delivered.
constexpr std::chrono::seconds kGoodConnection{10};
constexpr std::chrono::milliseconds kGoodbye{500};

// Only a person can end these; trying again quickly would not help.
bool IsRefusal(absl::StatusCode code) {
  switch (code) {
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kFailedPrecondition:
    case absl::StatusCode::kAlreadyExists:
    case absl::StatusCode::kAborted:
    case absl::StatusCode::kPermissionDenied:
    case absl::StatusCode::kUnauthenticated:
    case absl::StatusCode::kUnimplemented:
      return true;
    default:
      return false;
  }
}

// Totals only grow, and so does their sum.
uint64_t CountedIn(const CameraReport& report) {
  uint64_t sum = 0;
  for (const Refusal& refusal : report.refused) sum += refusal.count;
  if (const auto& frames = report.frames) {
    sum += frames->received + frames->damaged + frames->lost + frames->reconnects;
  }
  return sum;
}

}  // namespace

absl::Status UplinkOptions::Validate() const {
  FaultList faults;
  if (incarnation == 0) faults.Add("incarnation must be at least 1");
  if (stream_epoch == 0) faults.Add("stream_epoch must be at least 1");
  if (max_batch_rows == 0) faults.Add("max_batch_rows must be at least 1");
  if (flush_interval.count() <= 0) faults.Add("flush_interval must be above 0");
  if (ping_interval.count() <= 0) faults.Add("ping_interval must be above 0");
  if (silence_timeout <= ping_interval) {
    faults.Add("silence_timeout must be above ping_interval");
  }
  if (lowest_wait.count() <= 0 || highest_wait < lowest_wait) {
    faults.Add("lowest_wait must be above 0 and at most highest_wait");
  }
  for (const auto& [what, name] : {std::pair("agent_id", agent_id), std::pair("rig", rig)}) {
    faults.Add(ValidateName(what, name));
  }
  faults.Add(previews.Validate());
  return faults.Result("uplink: ");
}

std::shared_ptr<grpc::Channel> Uplink::MakeChannel(const std::string& address) {
  grpc::ChannelArguments arguments;
  // The server is in the same lab; a proxy that is meant for the web is never the way to it.
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 10'000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10'000);
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  // Shared subchannels would make a fresh channel wait for the backoff of the one before.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  return grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
}

absl::StatusOr<std::unique_ptr<Uplink>> Uplink::Create(
    UplinkOptions options, std::vector<std::unique_ptr<ObservationSource>> sources,
    ObservationSpool* spool, ChannelFactory make_channel) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  std::unique_ptr<Uplink> uplink(new Uplink(std::move(options), spool, std::move(make_channel)));
  RIGCAL_ASSIGN_OR_RETURN(
      uplink->captures_,
      CaptureControl::Create(std::move(sources), spool, [raw = uplink.get()] { raw->Wake(); }));
  uplink->previews_ = std::make_unique<PreviewWorker>(uplink->options_.previews,
                                                      [raw = uplink.get()] { raw->Wake(); });
  for (const CameraDescription& camera : uplink->captures_->cameras()) {
    if (camera.clock.timebase.empty()) uplink->plan_.RequireAlignment(camera.camera);
  }
  return uplink;
}

Uplink::Uplink(UplinkOptions options, ObservationSpool* spool, ChannelFactory make_channel)
    : options_(std::move(options)),
      spool_(spool),
      make_channel_(std::move(make_channel)),
      plan_(spool, options_.flush_interval),
      backoff_(options_.lowest_wait, options_.highest_wait, std::random_device{}()) {}

Uplink::~Uplink() { Shutdown(std::chrono::milliseconds(0)); }

void Uplink::Start() {
  captures_->Start();
  thread_ = std::thread([this] { Run(); });
}

uint32_t Uplink::Shutdown(std::chrono::milliseconds patience) {
  {
    const std::lock_guard lock(mutex_);
    if (!leave_by_) leave_by_ = Clock::now() + patience;
  }
  // An uplink whose creation failed half-way has none.
  if (captures_) captures_->EndAll();
  Wake();
  if (thread_.joinable()) thread_.join();
  if (previews_) previews_->Shutdown();
  spool_->Shutdown();
  if (captures_) captures_->Shutdown();
  uint32_t lost = 0;
  for (const SpooledStream& spooled : spool_->Streams()) {
    const uint32_t count = spool_->Discard(spooled.stream);
    lost += count;
    if (count == 0) continue;
    spdlog::warn("camera {}: {} observations of session {} were not acknowledged and are lost",
                 spooled.stream.camera, count, spooled.stream.session_id);
  }
  return lost;
}

void Uplink::Wake() {
  {
    const std::lock_guard lock(mutex_);
    woken_ = true;
  }
  woken_changed_.notify_all();
}

void Uplink::WaitUntil(Clock::time_point deadline) {
  std::unique_lock lock(mutex_);
  if (leave_by_) deadline = std::min(deadline, *leave_by_);
  woken_changed_.wait_until(lock, deadline, [this] { return woken_; });
  woken_ = false;
}

bool Uplink::IsTimeToLeave() const {
  const std::lock_guard lock(mutex_);
  return leave_by_ && (Clock::now() >= *leave_by_ || plan_.IsDelivered());
}

void Uplink::Run() {
  while (!IsTimeToLeave()) {
    Connected connected;
    ++connection_;
    connected.connection = std::make_unique<ServerConnection>(make_channel_(), [this] { Wake(); });
    const absl::Status status = Serve(connected);
    connected.connection.reset();
    if (IsTimeToLeave()) return;
    const Clock::time_point next_attempt = Clock::now() + WaitAfter(connected, status);
    while (Clock::now() < next_attempt && !IsTimeToLeave()) WaitUntil(next_attempt);
  }
}

absl::Status Uplink::Serve(Connected& connected) {
  ServerConnection& connection = *connected.connection;
  connected.start = connected.last_heard = connected.next_ping = connected.next_report =
      Clock::now();
  // Whoever asked over an earlier connection waits no more.
  previews_->Forget();
  connection.Write(MakeHello());
  while (true) {
    for (const v1::ServerMessage& message : connection.TakeMessages()) Handle(connected, message);
    if (!connected.fault.ok()) return connected.fault;
    if (const auto result = connection.Result()) {
      return result->ok() ? absl::UnavailableError("the server ended the stream") : *result;
    }
    RIGCAL_RETURN_IF_ERROR(CheckTimeouts(connected));
    if (IsTimeToLeave()) {
      connection.FinishWriting();
      const Clock::time_point give_up = Clock::now() + kGoodbye;
      while (!connection.Result() && Clock::now() < give_up) {
        connection.TakeMessages();
        std::unique_lock lock(mutex_);
        woken_changed_.wait_until(lock, give_up, [this] { return woken_; });
        woken_ = false;
      }
      return absl::OkStatus();
    }
    if (connected.greeted && connection.CanWrite()) {
      if (auto message = NextMessage(connected)) {
        connection.Write(*std::move(message));
        continue;
      }
    }
    WaitUntil(NextDeadline(connected));
  }
}

absl::Status Uplink::CheckTimeouts(const Connected& connected) const {
  const Clock::time_point now = Clock::now();
  if (!connected.greeted && now - connected.start >= options_.hello_timeout) {
    return absl::DeadlineExceededError(
        absl::StrCat("no answer within ", options_.hello_timeout.count(), " ms"));
  }
  if (now - connected.last_heard >= options_.silence_timeout) {
    return absl::DeadlineExceededError(
        absl::StrCat("the server has been silent for ", options_.silence_timeout.count(), " ms"));
  }
  return absl::OkStatus();
}

Uplink::Clock::time_point Uplink::NextDeadline(const Connected& connected) const {
  if (!connected.greeted) return connected.start + options_.hello_timeout;
  const Clock::time_point silent = connected.last_heard + options_.silence_timeout;
  // While a write is on its way nothing else can leave; its end wakes this thread.
  if (!connected.connection->CanWrite()) return silent;
  if (plan_.HasOpenStreams()) return Clock::now() + options_.flush_interval;
  return std::min(silent, connected.next_ping);
}

Backoff::Duration Uplink::WaitAfter(const Connected& connected, const absl::Status& status) {
  const std::string message = absl::StrCat("server ", options_.server, ": ", status.ToString());
  if (connected.progressed || Clock::now() - connected.start >= kGoodConnection) {
    backoff_.Reset();
  }
  const bool is_news = std::exchange(last_error_, message) != message || connected.greeted;
  if (connected.greeted && absl::IsInvalidArgument(status) && plan_.SuspectsFault()) {
    spdlog::error("{}", message);
    if (const auto given_up = plan_.OnProtocolFault(message)) {
      spdlog::error(
          "camera {}: the server does not understand the stream of session {}; it is "
          "given up, and {} observations are lost",
          given_up->stream.camera, given_up->stream.session_id, given_up->lost_count);
      captures_->EndStream(given_up->stream);
    }
    return backoff_.Next();
  }
  if (IsRefusal(status.code())) {
    spdlog::log(is_news ? spdlog::level::err : spdlog::level::debug, "{}; trying again in {} ms",
                message, options_.refused_wait.count());
    return options_.refused_wait;
  }
  const Backoff::Duration wait = backoff_.Next();
  spdlog::log(is_news ? spdlog::level::warn : spdlog::level::debug, "{}; trying again in {} ms",
              message, std::chrono::duration_cast<std::chrono::milliseconds>(wait).count());
  return wait;
}

v1::AgentMessage Uplink::MakeHello() {
  v1::AgentMessage message;
  v1::AgentHello* hello = message.mutable_hello();
  *hello->mutable_protocol_version() = wire::OwnProtocolVersion();
  hello->set_software_version(std::string(wire::kSoftwareVersion));
  hello->set_agent_id(options_.agent_id);
  hello->set_incarnation(options_.incarnation);
  hello->set_connection(connection_);
  hello->set_host(options_.host);
  hello->set_rig(options_.rig);
  for (const CameraDescription& camera : captures_->cameras()) {
    v1::AnnouncedCamera* announced = hello->add_cameras();
    *announced->mutable_description() = wire::ToProto(camera);
    announced->set_stream_epoch(options_.stream_epoch);
  }
  pending_.clear();
  for (const SpooledStream& spooled : spool_->Streams()) {
    pending_.push_back(spooled.stream);
    *hello->add_pending() = wire::ToProto(spooled.stream);
  }
  return message;
}

std::optional<v1::AgentMessage> Uplink::NextMessage(Connected& connected) {
  const Clock::time_point now = Clock::now();
  v1::AgentMessage message;
  if (now >= connected.next_ping) {
    connected.next_ping = now + options_.ping_interval;
    connected.ping_ns = MonotonicNowNs();
    message.mutable_time_ping()->set_host_monotonic_ns(*connected.ping_ns);
    return message;
  }
  if (now - connected.start >= options_.alignment_timeout) plan_.StopWaitingForAlignment();
  if (now >= connected.next_report) {
    if (auto report = NextReport()) return report;
    connected.next_report = now + options_.report_interval;
  }
  std::optional<DeliveryPlan::Message> next = plan_.Next(now);
  if (!next) {
    // Only when there is nothing else to say.
    std::optional<Preview> preview = previews_->TakeAnswer();
    if (!preview) return std::nullopt;
    *message.mutable_preview() = wire::ToProto(*std::move(preview));
    return message;
  }
  if (const auto* batch = std::get_if<ObservationBatch>(&*next)) {
    wire::ToProto(*batch, message.mutable_batch());
  } else {
    *message.mutable_end_of_capture() = wire::ToProto(std::get<EndOfCapture>(*next));
  }
  return message;
}

std::optional<v1::AgentMessage> Uplink::NextReport() {
  if (plan_.SendsOneAtATime()) return std::nullopt;
  for (const CameraReport& report : captures_->RunningReports()) {
    const uint64_t counted = CountedIn(report);
    if (counted == 0 || std::exchange(reported_[report.stream], counted) == counted) continue;
    v1::AgentMessage message;
    *message.mutable_report() = wire::ToProto(report);
    return message;
  }
  return std::nullopt;
}

}  // namespace rigcal::agent
