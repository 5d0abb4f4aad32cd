// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/api_calls.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <grpcpp/client_context.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/slice.h>

#include <chrono>
#include <list>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/grpc_status.h"
#include "rigcal/v1/live_service.pb.h"
#include "server/access/access_rules.h"
#include "server/api/gzip.h"
#include "server/rpc/api_messages.h"

namespace rigcal::server {
namespace {

using google::protobuf::Message;

// Beyond the longest preview.
constexpr std::chrono::seconds kCallLimit{40};
constexpr int kFastGzip = 1;
constexpr size_t kMinGzipBytes = 1024;

std::unique_ptr<Message> NewMessage(const google::protobuf::Descriptor* type) {
  return std::unique_ptr<Message>(
      google::protobuf::MessageFactory::generated_factory()->GetPrototype(type)->New());
}

std::string BytesOf(const grpc::ByteBuffer& buffer) {
  std::vector<grpc::Slice> slices;
  std::string bytes;
  bytes.reserve(buffer.Length());
  if (!buffer.Dump(&slices).ok()) return bytes;
  for (const grpc::Slice& slice : slices) {
    bytes.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
  }
  return bytes;
}

// What is known of the last live states: many clients ask for the same few, which are read and made
// JSON once.
class LiveTexts {
 public:
  struct Text {
    std::string etag;
    std::shared_ptr<const ApiBody> body;  // null: nobody has needed it so far
  };

  // Of the answer with these bytes; none: it is not known.
  std::optional<Text> Find(const std::string& bytes) {
    const std::lock_guard lock(mutex_);
    for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
      if (entry->bytes != bytes) continue;
      entries_.splice(entries_.begin(), entries_, entry);
      return entry->text;
    }
    return std::nullopt;
  }
  void Set(const std::string& bytes, const Text& text) {
    const std::lock_guard lock(mutex_);
    std::erase_if(entries_, [&](const Entry& entry) { return entry.bytes == bytes; });
    entries_.push_front({bytes, text});
    if (entries_.size() > kMaxEntries) entries_.pop_back();
  }

 private:
  static constexpr size_t kMaxEntries = 16;
  struct Entry {
    std::string bytes;
    Text text;
  };
  std::mutex mutex_;
  std::list<Entry> entries_;  // the one used last at the front
};

// What outlives the gateway until its last call has ended.
struct Shared {
  explicit Shared(std::shared_ptr<grpc::Channel> channel) : stub(std::move(channel)) {}

  grpc::GenericStub stub;
  LiveTexts live_texts;
};

struct OngoingCall {
  grpc::ClientContext context;
  grpc::ByteBuffer request;
  grpc::ByteBuffer answer;
  const google::protobuf::MethodDescriptor* method = nullptr;
  const ApiRoute* route = nullptr;
  std::string known_etag;
  bool unchanged = false;  // the client has the answer: it is not asked for
};
using Ongoing = std::shared_ptr<OngoingCall>;

absl::Status UnreadableAnswer() {
  return absl::InternalError("the service's answer cannot be read");
}

absl::StatusOr<ApiAnswer> JsonAnswer(const Message& message) {
  RIGCAL_ASSIGN_OR_RETURN(std::string json, JsonOf(message));
  return ApiAnswer{.body = std::make_shared<ApiBody>(ApiBody{std::move(json), ""})};
}

// Takes the value of a field of texts out of a message; "": it has no such field.
std::string TakeText(const char* name, Message* message) {
  const auto* field = message->GetDescriptor()->FindFieldByName(name);
  if (field == nullptr) return "";
  std::string text = message->GetReflection()->GetString(*message, field);
  message->GetReflection()->ClearField(message, field);
  return text;
}

// A bytes field as it is, and the rest as JSON.
absl::StatusOr<ApiAnswer> BytesAnswer(const ApiRoute& route, Message* message) {
  const auto* field = message->GetDescriptor()->FindFieldByName(std::string(route.bytes_field));
  if (field == nullptr) return absl::InternalError("the answer has no such field");
  auto body = std::make_shared<ApiBody>();
  body->text = message->GetReflection()->GetString(*message, field);
  message->GetReflection()->ClearField(message, field);
  std::string content_type = TakeText("content_type", message);
  std::string file_name = TakeText("file_name", message);
  RIGCAL_ASSIGN_OR_RETURN(std::string info, JsonOf(*message));
  info.resize(info.find_last_not_of('\n') + 1);
  return ApiAnswer{.body = std::move(body),
                   .info = info == "{}" ? "" : std::move(info),
                   .content_type = std::move(content_type),
                   .file_name = std::move(file_name)};
}

absl::StatusOr<ApiAnswer> LiveAnswer(Shared* shared, const std::string& bytes,
                                     const std::string& known_etag) {
  std::optional<LiveTexts::Text> text = shared->live_texts.Find(bytes);
  const bool is_known = text.has_value();
  v1::GetLiveResponse message;
  if (!is_known || (text->body == nullptr && text->etag != known_etag)) {
    if (!message.ParseFromString(bytes)) return UnreadableAnswer();
    text = {.etag = message.live().revision(), .body = nullptr};
  }
  ApiAnswer answer{.etag = text->etag};
  answer.unchanged = !answer.etag.empty() && answer.etag == known_etag;
  if (!answer.unchanged && text->body == nullptr) {
    RIGCAL_ASSIGN_OR_RETURN(std::string json, JsonOf(message));
    auto body = std::make_shared<ApiBody>();
    if (json.size() >= kMinGzipBytes) body->gzipped = Gzipped(json, kFastGzip);
    body->text = std::move(json);
    text->body = std::move(body);
    shared->live_texts.Set(bytes, *text);
  } else if (!is_known) {
    shared->live_texts.Set(bytes, *text);
  }
  answer.body = text->body;
  return answer;
}

ApiAnswer AnswerOf(Shared* shared, const OngoingCall& call, const grpc::Status& status) {
  // gRPC says no more where it has no such service.
  if (status.error_code() == grpc::StatusCode::UNIMPLEMENTED && status.error_message().empty()) {
    return {.status = absl::UnimplementedError(
                absl::StrCat("this server does not serve ", call.method->full_name()))};
  }
  if (!status.ok()) return {.status = wire::FromGrpc(status)};
  const std::string bytes = BytesOf(call.answer);
  absl::StatusOr<ApiAnswer> answer;
  if (call.method->output_type() == v1::GetLiveResponse::descriptor()) {
    answer = LiveAnswer(shared, bytes, call.known_etag);
    return answer.ok() ? *std::move(answer) : ApiAnswer{.status = answer.status()};
  }
  const std::unique_ptr<Message> message = NewMessage(call.method->output_type());
  if (!message->ParseFromString(bytes)) return {.status = UnreadableAnswer()};
  if (!call.route->bytes_field.empty()) {
    answer = BytesAnswer(*call.route, message.get());
  } else {
    answer = JsonAnswer(*message);
  }
  return answer.ok() ? *std::move(answer) : ApiAnswer{.status = answer.status()};
}

class ApiCalls final : public ApiGateway {
 public:
  ApiCalls(std::shared_ptr<grpc::Channel> channel, CallSecurity* security, const LiveAnswers* live)
      : shared_(std::make_shared<Shared>(std::move(channel))), security_(*security), live_(*live) {}

  void Call(ApiRequest request, std::function<void(Work)> done) override {
    auto call = std::make_shared<OngoingCall>();
    if (absl::Status status = Prepare(std::move(request), call.get()); !status.ok()) {
      done([status] { return ApiAnswer{.status = status}; });
      return;
    }
    if (call->unchanged) {
      done([etag = call->known_etag] { return ApiAnswer{.etag = etag, .unchanged = true}; });
      return;
    }
    shared_->stub.UnaryCall(
        &call->context, std::string(call->route->rpc), grpc::StubOptions(), &call->request,
        &call->answer,
        [shared = shared_, call, done = std::move(done)](const grpc::Status& status) {
          done([shared, call, status] { return AnswerOf(shared.get(), *call, status); });
        });
  }

  absl::Status Check(const Peer& peer, std::string_view rpc) override {
    return security_.CheckPeer(peer, rpc);
  }

 private:
  absl::Status Prepare(ApiRequest request, OngoingCall* call) {
    RIGCAL_RETURN_IF_ERROR(Check(request.peer, request.route->rpc));
    call->route = request.route;
    call->method = FindMethod(request.route->rpc);
    if (call->method == nullptr) return absl::UnimplementedError("this server has no such RPC");
    const std::unique_ptr<Message> message = NewMessage(call->method->input_type());
    RIGCAL_RETURN_IF_ERROR(FillMessage(request, message.get()));
    std::string bytes;
    if (!message->SerializeToString(&bytes)) return absl::InternalError("no memory");
    const grpc::Slice slice(bytes);
    call->request = grpc::ByteBuffer(&slice, 1);
    call->known_etag = std::move(request.known_etag);
    if (!call->known_etag.empty() &&
        call->method->input_type() == v1::GetLiveRequest::descriptor()) {
      const auto& live_request = static_cast<const v1::GetLiveRequest&>(*message);
      call->unchanged = live_.Revision(live_request) == call->known_etag;
    }
    call->context.set_deadline(std::chrono::system_clock::now() + kCallLimit);
    security_.AddCaller({std::move(request.peer), std::move(request.address)}, &call->context);
    return absl::OkStatus();
  }

  const std::shared_ptr<Shared> shared_;
  CallSecurity& security_;
  const LiveAnswers& live_;
};

}  // namespace

std::unique_ptr<ApiGateway> MakeApiGateway(std::shared_ptr<grpc::Channel> channel,
                                           CallSecurity* security, const LiveAnswers* live) {
  return std::make_unique<ApiCalls>(std::move(channel), security, live);
}

}  // namespace rigcal::server
