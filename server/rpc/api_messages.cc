// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/api_messages.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "common/status/status_macros.h"
#include "common/text/nesting.h"
#include "rigcal/v1/live_service.pb.h"

namespace rigcal::server {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::DescriptorPool;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using FieldJson = nlohmann::ordered_json;

std::string Quoted(const std::string& text) {
  return absl::StrCat("'", absl::CHexEscape(text.substr(0, 80)), "'");
}

absl::Status ParseJson(const std::string& json, Message* message) {
  // protobuf takes a list, a text or nothing at all for a message without fields.
  const size_t begin = json.find_first_not_of(" \t\r\n");
  if (begin == std::string::npos) return absl::OkStatus();
  if (json[begin] != '{') return absl::InvalidArgumentError("the body must be a JSON object");
  if (LineNestedTooDeep(NestedFormat::kJson, json)) {
    return absl::InvalidArgumentError(absl::StrCat("the body ", kNestedTooDeep));
  }
  try {
    const auto status = google::protobuf::util::JsonStringToMessage(json, message);
    if (status.ok()) return absl::OkStatus();
    return absl::InvalidArgumentError(
        absl::StrCat("the body is no ", message->GetDescriptor()->name(), ": ",
                     absl::CHexEscape(std::string(status.message()).substr(0, 500))));
  } catch (const std::exception& error) {
    return absl::InvalidArgumentError(absl::StrCat("the body cannot be read: ", error.what()));
  }
}

std::string QueryFieldsOf(const Descriptor& type) {
  std::vector<std::string> names;
  for (int i = 0; i < type.field_count(); ++i) {
    if (IsQueryField(*type.field(i))) names.push_back(type.field(i)->name());
  }
  return names.empty() ? "none" : absl::StrJoin(names, ", ");
}

// A value as protobuf JSON reads it for this field; numbers may be quoted there.
absl::StatusOr<FieldJson> ValueOf(const FieldDescriptor& field, const std::string& value) {
  if (field.type() != FieldDescriptor::TYPE_BOOL) return FieldJson(value);
  if (value == "true" || value == "1" || value.empty()) return FieldJson(true);
  if (value == "false" || value == "0") return FieldJson(false);
  return absl::InvalidArgumentError(
      absl::StrCat(field.name(), ": must be true or false, not ", Quoted(value)));
}

absl::Status MergeParameter(const UrlParameter& parameter, Message* message) {
  const Descriptor& type = *message->GetDescriptor();
  const FieldDescriptor* field = type.FindFieldByName(parameter.name);
  if (field == nullptr || !IsQueryField(*field)) {
    return absl::InvalidArgumentError(absl::StrCat("the parameter ", Quoted(parameter.name),
                                                   " of the address is not known; ",
                                                   "there are: ", QueryFieldsOf(type)));
  }
  RIGCAL_ASSIGN_OR_RETURN(FieldJson value, ValueOf(*field, parameter.value));
  if (field->is_repeated()) value = FieldJson::array({value});
  const std::string json =
      FieldJson{{parameter.name, value}}.dump(-1, ' ', false, FieldJson::error_handler_t::replace);
  const std::unique_ptr<Message> part(message->New());
  if (!google::protobuf::util::JsonStringToMessage(json, part.get()).ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat(parameter.name, ": cannot be ", Quoted(parameter.value)));
  }
  message->MergeFrom(*part);
  return absl::OkStatus();
}

absl::Status SetVariable(const UrlParameter& variable, Message* message) {
  const FieldDescriptor* field = message->GetDescriptor()->FindFieldByName(variable.name);
  if (field == nullptr || field->type() != FieldDescriptor::TYPE_STRING || field->is_repeated()) {
    return absl::InternalError(absl::StrCat("the route has no field ", variable.name));
  }
  const google::protobuf::Reflection& reflection = *message->GetReflection();
  const std::string given = reflection.GetString(*message, field);
  if (!given.empty() && given != variable.value) {
    return absl::InvalidArgumentError(absl::StrCat(variable.name, ": is ", Quoted(variable.value),
                                                   " in the address and ", Quoted(given),
                                                   " in the request"));
  }
  reflection.SetString(message, field, variable.value);
  return absl::OkStatus();
}

}  // namespace

bool IsQueryField(const FieldDescriptor& field) {
  if (field.type() != FieldDescriptor::TYPE_MESSAGE) return true;
  const std::string& type = field.message_type()->full_name();
  return type == "google.protobuf.Duration" || type == "google.protobuf.Timestamp";
}

const google::protobuf::MethodDescriptor* FindMethod(std::string_view rpc) {
  // The linker keeps what somebody names.
  static const Descriptor* const kLive = v1::GetLiveRequest::descriptor();
  (void)kLive;
  if (!rpc.starts_with('/')) return nullptr;
  const std::string name = absl::StrReplaceAll(std::string(rpc.substr(1)), {{"/", "."}});
  return DescriptorPool::generated_pool()->FindMethodByName(name);
}

absl::Status FillMessage(const ApiRequest& request, Message* message) {
  if (request.route->HasBody()) {
    if (!request.parameters.empty()) {
      return absl::InvalidArgumentError("a POST takes its fields from the body, not the address");
    }
    RIGCAL_RETURN_IF_ERROR(ParseJson(request.body, message));
  } else if (!request.body.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(std::string(request.route->method),
                                                   " has no body: its fields are in the address"));
  }
  for (const UrlParameter& parameter : request.parameters) {
    RIGCAL_RETURN_IF_ERROR(MergeParameter(parameter, message));
  }
  for (const UrlParameter& variable : request.variables) {
    RIGCAL_RETURN_IF_ERROR(SetVariable(variable, message));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> JsonOf(const Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  std::string json;
  const auto status = google::protobuf::util::MessageToJsonString(message, &json, options);
  if (status.ok()) return json + "\n";
  return absl::InternalError(
      absl::StrCat("the answer cannot be JSON: ", std::string(status.message())));
}

}  // namespace rigcal::server
