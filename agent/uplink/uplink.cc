// SPDX-License-Identifier: Apache-2.0
#include "agent/uplink/uplink.h"

#include <grpcpp/create_channel.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <random>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/uplink/uplink_connection.h"
#include "common/failpoint/failpoint.h"
#include "common/log/correlation_id.h"
#include "common/log/log_fields.h"
#include "common/status/guarded.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr std::chrono::milliseconds kGoodbye{500};

// Only a person can end these; trying again quickly would not help.
bool IsRefusal(absl::StatusCode code) {
  using enum absl::StatusCode;
  constexpr absl::StatusCode kRefusals[] = {kInvalidArgument, kFailedPrecondition, kAlreadyExists,
                                            kAborted,         kPermissionDenied,   kUnauthenticated,
                                            kUnimplemented};
  return std::ranges::find(kRefusals, code) != std::end(kRefusals);
}

}  // namespace

std::shared_ptr<grpc::Channel> Uplink::MakeChannel(const std::string& address,
                                                   const wire::ClientIdentity& identity,
                                                   bool of_several) {
  const int keepalive_ms = of_several ? 2'000 : 10'000;
  grpc::ChannelArguments arguments;
  // The server is in the same network: a web proxy never leads to it.
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, keepalive_ms);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, keepalive_ms);
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  // Shared subchannels would make a fresh channel wait for the backoff of the one before.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  const auto credentials = wire::CredentialsFor(address, identity);
  if (!credentials.ok()) spdlog::error("{}", std::string(credentials.status().message()));
  return grpc::CreateCustomChannel(address, credentials.ok() ? *credentials : nullptr, arguments);
}

absl::StatusOr<std::unique_ptr<Uplink>> Uplink::Create(
    UplinkOptions options, std::vector<std::unique_ptr<ObservationSource>> sources,
    ObservationSpool* spool, ChannelFactory make_channel, std::unique_ptr<CameraOffers> offers) {
  std::unique_ptr<Uplink> uplink(new Uplink(std::move(options), spool, std::move(make_channel)));
  const auto wake = [raw = uplink.get()] { raw->Wake(); };
  RIGCAL_ASSIGN_OR_RETURN(uplink->cameras_, MakePipelines(std::move(sources), spool, wake));
  uplink->offers_ = std::move(offers);
  if (!uplink->options_.known_servers_file.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(uplink->known_servers_,
                            KnownServers::Open(uplink->options_.known_servers_file));
    uplink->agent_.known_servers = &*uplink->known_servers_;
  }
  uplink->agent_.spool = spool;
  uplink->agent_.cameras = &uplink->cameras_;
  uplink->agent_.offers = uplink->offers_.get();
  uplink->agent_.plan = &uplink->plan_;
  uplink->ServeCameras();
  for (const auto& [name, pipeline] : uplink->cameras_) {
    if (pipeline->description().clock.timebase.empty()) uplink->plan_.RequireAlignment(name);
  }
  return uplink;
}

Uplink::Uplink(UplinkOptions options, ObservationSpool* spool, ChannelFactory make_channel)
    : options_(std::move(options)),
      spool_(spool),
      make_channel_(std::move(make_channel)),
      plan_(spool, options_.flush_interval, options_.keeps_until_standby),
      backoff_(options_.lowest_wait, options_.highest_wait, std::random_device{}()),
      servers_(options_.servers) {
  if (servers_.size() > 1) options_.hello_timeout = options_.hello_timeout_of_several;
}

void Uplink::Start() {
  for (const auto& [name, pipeline] : cameras_) pipeline->Start();
  thread_ = std::thread([this] { Run(); });
  if (offers_) offers_->Start([this] { Wake(); }, [this] { return IsCapturing(); });
}

void Uplink::ServeCameras() {
  const auto wake = [this] { Wake(); };
  previews_ = std::make_unique<PreviewWorker>(options_.previews, wake);
  DetectorLearner::Detectors detectors;
  for (const auto& [name, pipeline] : cameras_) detectors[name] = pipeline->detector_control();
  detectors_ = std::make_unique<DetectorLearner>(options_.learning, std::move(detectors), wake);
  agent_.previews = previews_.get();
  agent_.detectors = detectors_.get();
}

void Uplink::ChangeCameras() {
  if (!offers_) return;
  std::optional<CameraOffers::Change> change = offers_->TakeChange();
  if (!change) return;
  offers_->Settle(Guarded("changing the cameras", [&] { return Make(*std::move(change)); }));
}

absl::Status Uplink::Make(CameraOffers::Change change) {
  RIGCAL_RETURN_IF_ERROR(CheckDrop(change.dropped));
  // They use what is about to go; what they were asked is asked again.
  previews_->Shutdown();
  detectors_->Shutdown();
  {
    const std::lock_guard lock(cameras_mutex_);
    if (change.added) {
      const std::string name = change.added->description().camera;
      auto pipeline =
          std::make_unique<CameraPipeline>(std::move(change.added), spool_, [this] { Wake(); });
      if (pipeline->description().clock.timebase.empty()) plan_.RequireAlignment(name);
      pipeline->Start();
      cameras_.insert_or_assign(name, std::move(pipeline));
    } else {
      cameras_.erase(change.dropped);
    }
    cameras_changed_ = true;
  }
  ServeCameras();
  return absl::OkStatus();
}

absl::Status Uplink::CheckDrop(const std::string& camera) const {
  if (camera.empty()) return absl::OkStatus();
  for (const SpooledStream& spooled : spool_->Streams()) {
    if (spooled.stream.camera != camera) continue;
    return absl::FailedPreconditionError(
        absl::StrCat("camera ", camera, " has observations of session ", spooled.stream.session_id,
                     " that the server does not have yet; drop it when they are delivered"));
  }
  return absl::OkStatus();
}

bool Uplink::IsCapturing() const {
  const std::lock_guard lock(cameras_mutex_);
  return std::ranges::any_of(cameras_,
                             [](const auto& camera) { return !camera.second->Sessions().empty(); });
}

LeftBehind Uplink::Shutdown(std::chrono::milliseconds patience) {
  {
    const std::lock_guard lock(mutex_);
    if (!leave_by_) leave_by_ = Clock::now() + patience;
  }
  {
    const std::lock_guard lock(cameras_mutex_);
    for (const auto& [name, pipeline] : cameras_) pipeline->EndAll();
  }
  Wake();
  if (thread_.joinable()) thread_.join();
  if (offers_) offers_->Shutdown();
  if (previews_) previews_->Shutdown();  // none in an uplink whose creation failed
  if (detectors_) detectors_->Shutdown();
  spool_->Shutdown();
  for (const auto& [name, pipeline] : cameras_) pipeline->Shutdown();
  LeftBehind left;
  for (const SpooledStream& spooled : spool_->Streams()) {
    if (spooled.row_count == 0) continue;
    left.row_count += spooled.row_count;
    left.cameras.insert(spooled.stream.camera);
  }
  return left;
}

void Uplink::Wake() {
  const std::lock_guard lock(mutex_);
  woken_ = true;
  woken_changed_.notify_all();
}

void Uplink::Reconnect() {
  const std::lock_guard lock(mutex_);
  reconnect_ = true;
  woken_ = true;
  woken_changed_.notify_all();
}

bool Uplink::TakeReconnect() {
  const std::lock_guard lock(mutex_);
  return std::exchange(reconnect_, false);
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
    Backoff::Duration wait{0};
    const absl::Status fault = Guarded("the connection to the server", [&] {
      const LogScope scope({.correlation = NewCorrelationId()});
      Conversation conversation(options_, servers_.current(), ++connection_, &agent_, Clock::now());
      const absl::Status status = Serve(conversation);
      if (!status.ok() && !IsTimeToLeave()) wait = WaitAfter(conversation, status);
    });
    if (!fault.ok()) {
      // What is not acknowledged is in the spool.
      wait = backoff_.Next();
      spdlog::error(
          "{}; it is made again, and captures go on: if this is repeated, look at the memory of "
          "this PC, and restart the agent",
          std::string(fault.message()));
    }
    const Clock::time_point next_attempt = Clock::now() + wait;
    while (Clock::now() < next_attempt && !IsTimeToLeave()) {
      ChangeCameras();
      WaitUntil(next_attempt);
    }
  }
}

absl::Status Uplink::Serve(Conversation& conversation) {
  UplinkConnection connection(make_channel_(servers_.current(), servers_.size() > 1),
                              [this] { Wake(); });
  active_server_.clear();
  // Nobody waits any more for what was asked for over an earlier connection.
  previews_->Forget();
  detectors_->Forget();
  if (offers_) offers_->Forget();
  cameras_changed_ = false;
  connection.Write(conversation.Hello());
  while (true) {
    for (const v1::ConnectResponse& message : connection.TakeMessages()) {
      const bool is_hello = !conversation.greeted();
      RIGCAL_RETURN_IF_ERROR(conversation.Handle(message, Clock::now()));
      if (is_hello && conversation.greeted()) LearnServers(conversation);
    }
    if (const auto result = connection.Result()) {
      active_server_ = connection.ActiveServer();
      return result->ok() ? absl::UnavailableError("the server ended the stream") : *result;
    }
    RIGCAL_RETURN_IF_ERROR(conversation.CheckTimeouts(Clock::now()));
    if (TakeReconnect()) return absl::OkStatus();
    if (IsTimeToLeave()) {
      Leave(connection);
      return absl::OkStatus();
    }
    ChangeCameras();
    const bool can_write = connection.CanWrite();
    if (conversation.greeted() && can_write) {
      if (auto message = conversation.Next(Clock::now())) {
        connection.Write(*std::move(message));
        Failpoint("after_send");
        continue;
      }
      // The next hello announces the changed cameras; the answers have left.
      if (cameras_changed_ && !offers_->IsChanging()) {
        Leave(connection);
        return absl::OkStatus();
      }
    }
    WaitUntil(conversation.NextDeadline(Clock::now(), can_write));
  }
}

void Uplink::LearnServers(const Conversation& conversation) {
  servers_.Settle();
  if (!servers_.Learn(conversation.servers())) return;
  options_.hello_timeout = options_.hello_timeout_of_several;
  spdlog::info("servers that take turns: {}", servers_.text());
  if (options_.learned) options_.learned(servers_);
}

void Uplink::Leave(UplinkConnection& connection) {
  connection.FinishWriting();
  const Clock::time_point give_up = Clock::now() + kGoodbye;
  while (!connection.Result() && Clock::now() < give_up) {
    connection.TakeMessages();
    std::unique_lock lock(mutex_);
    woken_changed_.wait_until(lock, give_up, [this] { return woken_; });
    woken_ = false;
  }
}

Backoff::Duration Uplink::WaitAfter(const Conversation& conversation, const absl::Status& status) {
  const std::string server = servers_.current();
  const std::string message = absl::StrCat("server ", server, ": ", status.ToString());
  if (conversation.IsGood(Clock::now())) backoff_.Reset();
  const bool is_news =
      std::exchange(last_error_[server], message) != message || conversation.greeted();
  if (conversation.greeted() && absl::IsInvalidArgument(status) && plan_.SuspectsFault()) {
    spdlog::error("{}", message);
    if (const auto given_up = plan_.OnProtocolFault(message)) {
      spdlog::error(
          "camera {}: the server rejects the stream of session {} as malformed; the stream is "
          "abandoned, and {} observations are lost",
          given_up->stream.camera, given_up->stream.session_id, given_up->lost_count);
      // Streams of an earlier run may be of a camera that is not there any more.
      if (const auto camera = cameras_.find(given_up->stream.camera); camera != cameras_.end()) {
        camera->second->End(given_up->stream.session_id);
      }
    }
    return backoff_.Next();
  }
  if (servers_.MoveOn(active_server_)) {
    spdlog::log(is_news ? spdlog::level::warn : spdlog::level::debug, "{}; trying server {}",
                message, servers_.current());
    return Backoff::Duration(0);
  }
  if (IsRefusal(status.code())) {
    spdlog::log(is_news ? spdlog::level::err : spdlog::level::debug, "{}; trying again in {} ms",
                message, options_.refused_wait.count());
    return options_.refused_wait;
  }
  Backoff::Duration wait = backoff_.Next();
  if (servers_.size() > 1) wait %= options_.highest_wait_of_several;
  // The server is there and has no room: it takes rows again as soon as it has.
  if (absl::IsResourceExhausted(status)) wait %= options_.longest_wait_for_room;
  spdlog::log(is_news ? spdlog::level::warn : spdlog::level::debug, "{}; trying again in {} ms",
              message, std::chrono::duration_cast<std::chrono::milliseconds>(wait).count());
  return wait;
}

}  // namespace rigcal::agent
