// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/agent_stream_link.h"

#include <string>
#include <utility>

#include "common/wire/agent_wire.h"
#include "common/wire/detector_wire.h"
#include "common/wire/offer_wire.h"
#include "common/wire/preview_wire.h"

namespace rigcal::server {
namespace {

class StreamLink final : public AgentLink {
 public:
  explicit StreamLink(std::weak_ptr<AgentStream> stream) : stream_(std::move(stream)) {}

  void SendStartCapture(const StartCaptureCommand& command) override {
    v1::ConnectResponse message;
    *message.mutable_start_capture() = wire::ToProto(command);
    if (const auto stream = stream_.lock()) stream->Send(std::move(message));
  }
  void SendStopCapture(const std::string& session_id) override {
    v1::ConnectResponse message;
    message.mutable_stop_capture()->set_session_id(session_id);
    if (const auto stream = stream_.lock()) stream->Send(std::move(message));
  }
  void SendPreviewRequest(const PreviewRequest& request) override {
    v1::ConnectResponse message;
    *message.mutable_preview_request() = wire::ToProto(request);
    if (const auto stream = stream_.lock()) stream->Send(std::move(message));
  }
  void SendDetectorRequest(const DetectorRequest& request) override {
    v1::ConnectResponse message;
    *message.mutable_detector_request() = wire::ToProto(request);
    if (const auto stream = stream_.lock()) stream->Send(std::move(message));
  }
  void SendChoiceRequest(const ChoiceRequest& request) override {
    v1::ConnectResponse message;
    *message.mutable_choice_request() = wire::ToProto(request);
    if (const auto stream = stream_.lock()) stream->Send(std::move(message));
  }
  void Close(const absl::Status& reason) override {
    if (const auto stream = stream_.lock()) stream->Close(reason);
  }

 private:
  const std::weak_ptr<AgentStream> stream_;
};

}  // namespace

std::shared_ptr<AgentLink> LinkTo(std::weak_ptr<AgentStream> stream) {
  return std::make_shared<StreamLink>(std::move(stream));
}

}  // namespace rigcal::server
