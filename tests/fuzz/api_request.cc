// SPDX-License-Identifier: Apache-2.0
// A call of the JSON API on its way to the RPC: the route, the query, and the body as a message of
// any of the services. The input is "METHOD PATH?QUERY", a line end, and the body.
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <google/protobuf/util/json_util.h>
#include <google/protobuf/util/message_differencer.h>

#include <algorithm>
#include <memory>
#include <string>
#include <string_view>

#include "server/api/api_routes.h"
#include "server/rpc/api_messages.h"
#include "tests/fuzz/fuzz_check.h"

namespace {

using google::protobuf::Message;
using rigcal::server::ApiRequest;

constexpr size_t kMaxFaultBytes = 1000;

// A fault of the client's, in words that do no harm in a log.
void CheckFault(const absl::Status& fault) {
  FUZZ_CHECK(fault.code() == absl::StatusCode::kInvalidArgument);
  FUZZ_CHECK(!fault.message().empty() && fault.message().size() < kMaxFaultBytes);
  FUZZ_CHECK(std::ranges::none_of(fault.message(), [](unsigned char c) { return c < 0x20; }));
}

std::unique_ptr<Message> NewRequest(const rigcal::server::ApiRoute& route) {
  const auto* method = rigcal::server::FindMethod(route.rpc);
  FUZZ_CHECK(method != nullptr);
  return std::unique_ptr<Message>(google::protobuf::MessageFactory::generated_factory()
                                      ->GetPrototype(method->input_type())
                                      ->New());
}

// What has been read can be written, and is the same when it is read again.
void CheckRoundTrip(const Message& message) {
  std::string bytes;
  FUZZ_CHECK(message.SerializeToString(&bytes));
  const auto json = rigcal::server::JsonOf(message);
  // Times and durations beyond the range of protobuf are refused later, as in gRPC.
  if (!json.ok()) return;
  const std::unique_ptr<Message> again(message.New());
  FUZZ_CHECK(google::protobuf::util::JsonStringToMessage(*json, again.get()).ok());
  google::protobuf::util::MessageDifferencer same;
  same.set_float_comparison(google::protobuf::util::MessageDifferencer::APPROXIMATE);
  google::protobuf::util::DefaultFieldComparator comparator;
  comparator.set_treat_nan_as_equal(true);
  same.set_field_comparator(&comparator);
  FUZZ_CHECK(same.Compare(message, *again));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view input(reinterpret_cast<const char*>(data), size);
  const size_t line_end = std::min(input.find('\n'), input.size());
  const std::string_view line = input.substr(0, line_end);
  const size_t space = std::min(line.find(' '), line.size());
  const std::string_view address = line.substr(std::min(space + 1, line.size()));
  const size_t mark = std::min(address.find('?'), address.size());
  const rigcal::server::ApiMatch match = rigcal::server::MatchApiRoute(
      std::string(line.substr(0, space)), std::string(address.substr(0, mark)));
  if (match.route == nullptr) return 0;
  auto parameters = rigcal::server::ParseUrlQuery(
      std::string(address.substr(std::min(mark + 1, address.size()))));
  if (!parameters.ok()) {
    CheckFault(parameters.status());
    return 0;
  }
  ApiRequest request;
  request.route = match.route;
  request.variables = match.variables;
  request.parameters = *std::move(parameters);
  request.body = std::string(input.substr(std::min(line_end + 1, input.size())));
  const std::unique_ptr<Message> message = NewRequest(*match.route);
  const absl::Status status = rigcal::server::FillMessage(request, message.get());
  if (!status.ok()) {
    CheckFault(status);
    return 0;
  }
  // What the path says is what is done.
  for (const auto& [name, value] : request.variables) {
    const auto* field = message->GetDescriptor()->FindFieldByName(name);
    FUZZ_CHECK(field != nullptr);
    FUZZ_CHECK(message->GetReflection()->GetString(*message, field) == value);
  }
  CheckRoundTrip(*message);
  return 0;
}
