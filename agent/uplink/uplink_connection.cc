// SPDX-License-Identifier: Apache-2.0
#include "agent/uplink/uplink_connection.h"

#include <iterator>
#include <string>
#include <utility>

#include "common/log/correlation_id.h"
#include "common/log/log_fields.h"
#include "common/wire/grpc_status.h"
#include "common/wire/server_list.h"

namespace rigcal::agent {
namespace {

constexpr size_t kMaxInbox = 256;

}  // namespace

UplinkConnection::UplinkConnection(std::shared_ptr<grpc::Channel> channel,
                                   std::function<void()> on_event)
    : on_event_(std::move(on_event)), stub_(v1::IngestService::NewStub(std::move(channel))) {
  const std::string& id = LogFields::Current().correlation;
  if (!id.empty()) context_.AddMetadata(kCorrelationKey, id);
  stub_->async()->Connect(&context_, this);
  // Writes start outside of gRPC's callbacks: without a hold the stream could be done before one.
  AddHold();
  reading_ = true;
  StartRead(&incoming_);
  StartCall();
}

UplinkConnection::~UplinkConnection() {
  Cancel();
  std::unique_lock lock(mutex_);
  inbox_.clear();
  ResumeReadingLocked();
  done_changed_.wait(lock, [this] { return result_.has_value(); });
}

bool UplinkConnection::CanWrite() const {
  const std::lock_guard lock(mutex_);
  return !writing_ && !broken_ && !finished_writing_;
}

void UplinkConnection::Write(v1::ConnectRequest message) {
  const std::lock_guard lock(mutex_);
  if (writing_ || broken_ || finished_writing_) return;
  writing_ = true;
  outgoing_ = std::move(message);
  // Under the lock: OnReadDone may give up the hold only before this or after it.
  StartWrite(&outgoing_);
}

void UplinkConnection::FinishWriting() {
  const std::lock_guard lock(mutex_);
  if (writing_ || broken_ || finished_writing_) return;
  finished_writing_ = true;
  StartWritesDone();
}

std::vector<v1::ConnectResponse> UplinkConnection::TakeMessages() {
  const std::lock_guard lock(mutex_);
  std::vector<v1::ConnectResponse> messages(std::make_move_iterator(inbox_.begin()),
                                            std::make_move_iterator(inbox_.end()));
  inbox_.clear();
  ResumeReadingLocked();
  return messages;
}

std::optional<absl::Status> UplinkConnection::Result() const {
  const std::lock_guard lock(mutex_);
  if (!inbox_.empty()) return std::nullopt;
  return result_;
}

std::string UplinkConnection::ActiveServer() const {
  const std::lock_guard lock(mutex_);
  if (!result_) return "";
  const auto& trailing = context_.GetServerTrailingMetadata();
  const auto named = trailing.find(wire::kActiveServerKey);
  return named == trailing.end() ? "" : std::string(named->second.data(), named->second.length());
}

void UplinkConnection::ResumeReadingLocked() {
  if (reading_ || broken_ || inbox_.size() >= kMaxInbox) return;
  reading_ = true;
  StartRead(&incoming_);
}

void UplinkConnection::OnReadDone(bool ok) {
  {
    const std::lock_guard lock(mutex_);
    reading_ = false;
    if (ok) {
      inbox_.push_back(std::move(incoming_));
      ResumeReadingLocked();
    } else {
      broken_ = true;
      RemoveHold();
    }
  }
  on_event_();
}

void UplinkConnection::OnWriteDone(bool ok) {
  {
    const std::lock_guard lock(mutex_);
    writing_ = false;
    // Why it failed comes with the end of the stream, which only a read that is waiting sees.
    if (!ok) finished_writing_ = true;
  }
  on_event_();
}

void UplinkConnection::OnDone(const grpc::Status& status) {
  // All of it under the lock, even the call: the destructor waits for this, and so may what
  // on_event_ refers to.
  const std::lock_guard lock(mutex_);
  result_ = wire::FromGrpc(status);
  on_event_();
  done_changed_.notify_all();
}

}  // namespace rigcal::agent
