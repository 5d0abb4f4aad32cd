// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/reflection_client.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <google/protobuf/text_format.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>

#include <chrono>

#include "common/wire/grpc_status.h"

namespace rigcal::testing {
namespace {

std::unique_ptr<google::protobuf::Message> NewMessage(const std::string& name) {
  // The library that has these messages must be linked in.
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  const auto* type = google::protobuf::DescriptorPool::generated_pool()->FindMessageTypeByName(
      "grpc.reflection.v1alpha." + name);
  const auto* prototype = google::protobuf::MessageFactory::generated_factory()->GetPrototype(type);
  return std::unique_ptr<google::protobuf::Message>(prototype->New());
}

}  // namespace

absl::StatusOr<std::string> CallRaw(const std::shared_ptr<grpc::Channel>& channel,
                                 const std::string& method, const std::string& request) {
  grpc::GenericStub stub(channel);
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  grpc::CompletionQueue queue;
  const auto call = stub.PrepareCall(&context, method, &queue);
  const auto next = [&queue] {
    void* tag = nullptr;
    bool ok = false;
    return queue.Next(&tag, &ok) && ok;
  };
  call->StartCall(nullptr);
  next();
  const grpc::Slice slice(request);
  call->Write(grpc::ByteBuffer(&slice, 1), nullptr);
  next();
  call->WritesDone(nullptr);
  next();
  grpc::ByteBuffer answer;
  call->Read(&answer, nullptr);
  const bool answered = next();
  // A stream goes on after its first answer; nobody waits for its end.
  if (answered) context.TryCancel();
  grpc::Status status;
  call->Finish(&status, nullptr);
  next();
  if (!answered) {
    return status.ok() ? absl::UnknownError("ended without an answer") : wire::FromGrpc(status);
  }
  grpc::Slice whole;
  answer.DumpToSingleSlice(&whole);
  return std::string(reinterpret_cast<const char*>(whole.begin()), whole.size());
}

std::string Reflect(const std::shared_ptr<grpc::Channel>& channel,
                    const std::string& request_text) {
  const auto request = NewMessage("ServerReflectionRequest");
  if (!google::protobuf::TextFormat::ParseFromString(request_text, request.get())) {
    return "not a request: " + request_text;
  }
  const auto answer =
      CallRaw(channel, "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
              request->SerializeAsString());
  if (!answer.ok()) return answer.status().ToString();
  const auto response = NewMessage("ServerReflectionResponse");
  if (!response->ParseFromString(*answer)) return "not an answer";
  return response->DebugString();
}

}  // namespace rigcal::testing
