// SPDX-License-Identifier: Apache-2.0
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/slice.h>

#include <memory>
#include <string>

#include "common/status/status_macros.h"
#include "common/wire/request_traits.h"
#include "rigcal/v1/live_service.grpc.pb.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/live_answers.h"
#include "server/rpc/services.h"

namespace rigcal::server {
namespace {

// The bytes themselves, which live until gRPC has sent them.
grpc::ByteBuffer BufferOf(std::shared_ptr<const std::string> bytes) {
  using Held = std::shared_ptr<const std::string>;
  auto* const held = new Held(std::move(bytes));
  const grpc::Slice slice(
      const_cast<char*>((*held)->data()), (*held)->size(),
      [](void* user_data) { delete static_cast<Held*>(user_data); }, held);
  return {&slice, 1};
}

// Takes and gives bytes: an answer is serialized once for all that poll.
class LiveService final
    : public v1::LiveService::WithRawCallbackMethod_GetLive<v1::LiveService::Service> {
 public:
  explicit LiveService(LiveAnswers* answers) : answers_(*answers) {}

  grpc::ServerUnaryReactor* GetLive(grpc::CallbackServerContext* context,
                                    const grpc::ByteBuffer* request,
                                    grpc::ByteBuffer* response) override {
    grpc::ServerUnaryReactor* const reactor = context->DefaultReactor();
    v1::GetLiveRequest message;
    grpc::ByteBuffer bytes(*request);
    grpc::Status status = wire::ReadMessage(&bytes, &message);
    if (status.ok()) {
      status = GuardedCall("GetLive", [&]() -> absl::Status {
        RIGCAL_ASSIGN_OR_RETURN(const LiveAnswers::Answer answer, answers_.Get(message));
        *response = BufferOf(answer.bytes);
        return absl::OkStatus();
      });
    }
    reactor->Finish(status);
    return reactor;
  }

 private:
  LiveAnswers& answers_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeLiveService(LiveAnswers* answers) {
  return std::make_unique<LiveService>(answers);
}

}  // namespace rigcal::server
