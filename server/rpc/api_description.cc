// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/api_description.h"

#include <google/protobuf/descriptor.h>

#include <algorithm>
#include <deque>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/wire/protocol_version.h"
#include "server/access/access_rules.h"
#include "server/api/api_routes.h"
#include "server/rpc/api_messages.h"

namespace rigcal::server {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::EnumDescriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::MethodDescriptor;
using Json = nlohmann::ordered_json;

// Writes the schemas of messages, and of all that they reach.
class Schemas {
 public:
  Json RefTo(const Descriptor& type) {
    if (named_.insert(type.full_name()).second) messages_.push_back(&type);
    return {{"$ref", absl::StrCat("#/components/schemas/", type.full_name())}};
  }

  Json Of(const FieldDescriptor& field) {
    const Json item = ItemOf(field);
    return field.is_repeated() ? Json{{"type", "array"}, {"items", item}} : item;
  }

  Json All() {
    Json all = Json::object();
    for (; !messages_.empty(); messages_.pop_front()) {
      const Descriptor& type = *messages_.front();
      Json properties = Json::object();
      for (int i = 0; i < type.field_count(); ++i) {
        properties[type.field(i)->name()] = Of(*type.field(i));
      }
      all[type.full_name()] = {{"type", "object"},
                               {"additionalProperties", false},
                               {"properties", std::move(properties)}};
    }
    for (const EnumDescriptor* type : enums_) {
      Json values = Json::array();
      for (int i = 0; i < type->value_count(); ++i) values.push_back(type->value(i)->name());
      all[type->full_name()] = {{"type", "string"}, {"enum", std::move(values)}};
    }
    return all;
  }

 private:
  struct ByName {
    bool operator()(const EnumDescriptor* a, const EnumDescriptor* b) const {
      return a->full_name() < b->full_name();
    }
  };

  Json ItemOf(const FieldDescriptor& field) {
    switch (field.type()) {
      case FieldDescriptor::TYPE_MESSAGE: {
        const std::string& type = field.message_type()->full_name();
        if (type == "google.protobuf.Timestamp") {
          return {{"type", "string"}, {"format", "date-time"}};
        }
        if (type == "google.protobuf.Duration") {
          return {{"type", "string"}, {"pattern", "^-?[0-9]+(\\.[0-9]{1,9})?s$"}};
        }
        return RefTo(*field.message_type());
      }
      case FieldDescriptor::TYPE_ENUM:
        enums_.insert(field.enum_type());
        return {{"$ref", absl::StrCat("#/components/schemas/", field.enum_type()->full_name())}};
      case FieldDescriptor::TYPE_BOOL:
        return {{"type", "boolean"}};
      case FieldDescriptor::TYPE_DOUBLE:
        return {{"type", "number"}, {"format", "double"}};
      case FieldDescriptor::TYPE_FLOAT:
        return {{"type", "number"}, {"format", "float"}};
      case FieldDescriptor::TYPE_BYTES:
        return {{"type", "string"}, {"format", "byte"}};
      case FieldDescriptor::TYPE_STRING:
        return {{"type", "string"}};
      default:
        break;
    }
    switch (field.cpp_type()) {
      case FieldDescriptor::CPPTYPE_INT32:
        return {{"type", "integer"}, {"format", "int32"}};
      case FieldDescriptor::CPPTYPE_UINT32:
        return {{"type", "integer"}, {"format", "int64"}, {"minimum", 0}};
      case FieldDescriptor::CPPTYPE_INT64:
        return {{"type", "string"}, {"format", "int64"}};
      default:
        return {{"type", "string"}, {"format", "uint64"}};
    }
  }

  std::deque<const Descriptor*> messages_;
  std::set<std::string> named_;
  std::set<const EnumDescriptor*, ByName> enums_;
};

Json Content(std::string_view type, Json schema) {
  return {{"content", {{std::string(type), {{"schema", std::move(schema)}}}}}};
}

Json ParametersOf(const ApiRoute& route, const Descriptor& request, Schemas* schemas) {
  Json parameters = Json::array();
  const std::vector<std::string> variables = VariablesOf(route.path);
  for (const std::string& variable : variables) {
    parameters.push_back(
        {{"name", variable}, {"in", "path"}, {"required", true}, {"schema", {{"type", "string"}}}});
  }
  for (int i = 0; !route.HasBody() && i < request.field_count(); ++i) {
    const FieldDescriptor& field = *request.field(i);
    if (!IsQueryField(field) || std::ranges::count(variables, field.name()) > 0) continue;
    parameters.push_back({{"name", field.name()}, {"in", "query"}, {"schema", schemas->Of(field)}});
  }
  if (route.HasBody() || route.method == "DELETE") {
    parameters.push_back({{"name", "X-Rigcal"},
                          {"in", "header"},
                          {"required", true},
                          {"description", "Any value: a page of another site cannot send it."},
                          {"schema", {{"type", "string"}}}});
  }
  return parameters;
}

std::string OperationId(const ApiRoute& route, const MethodDescriptor& method) {
  // Two routes lead to GetAccuracy.
  const bool verb = route.path.find("}:accuracy") != std::string_view::npos;
  return method.name() + (verb ? "AtPoints" : "");
}

Json OperationOf(const ApiRoute& route, const MethodDescriptor& method, Schemas* schemas) {
  const AccessRule* rule = FindAccessRule(route.rpc);
  Json operation = {
      {"operationId", OperationId(route, method)},
      {"tags", Json::array({method.service()->name()})},
      {"summary", std::string(route.summary)},
      {"description", absl::StrCat("RPC ", method.full_name(), "; for ",
                                   rule == nullptr ? "nobody" : rule->roles.ToString(), ".")},
      {"parameters", ParametersOf(route, *method.input_type(), schemas)}};
  if (route.HasBody()) {
    operation["requestBody"] = Content("application/json", schemas->RefTo(*method.input_type()));
  }
  Json answer = route.bytes_field.empty()
                    ? Content(route.content_type, schemas->RefTo(*method.output_type()))
                    : Content(route.content_type, {{"type", "string"}, {"format", "binary"}});
  answer["description"] = "Done.";
  Json refusal = Content("application/json", {{"$ref", "#/components/schemas/Error"}});
  refusal["description"] = "Refused; the code is that of gRPC.";
  operation["responses"] = {{"200", std::move(answer)}};
  if (route.method == "GET") {
    operation["responses"]["304"] = {{"description", "As the ETag in If-None-Match."}};
  }
  operation["responses"]["default"] = std::move(refusal);
  return operation;
}

std::string Lower(std::string_view text) {
  std::string lower(text);
  std::ranges::transform(lower, lower.begin(), [](char c) { return static_cast<char>(c | 0x20); });
  return lower;
}

}  // namespace

std::string ApiDescription() {
  Schemas schemas;
  Json paths = Json::object();
  for (const ApiRoute& route : ApiRoutes()) {
    const MethodDescriptor* method = FindMethod(route.rpc);
    if (method == nullptr) continue;  // a test finds it missing
    paths[std::string(route.path)][Lower(route.method)] = OperationOf(route, *method, &schemas);
  }
  Json all = schemas.All();
  all["Error"] = {{"type", "object"},
                  {"required", Json::array({"code", "message"})},
                  {"properties",
                   {{"code", {{"type", "string"}, {"example", "NOT_FOUND"}}},
                    {"message", {{"type", "string"}}}}}};
  const Json description = {
      {"openapi", "3.0.3"},
      {"info",
       {{"title", "rigcal"},
        {"version", std::string(wire::kSoftwareVersion)},
        {"description",
         "The services of rigcal.v1 as JSON: protobuf JSON with the names of the proto files, "
         "fields with their default left out, 64-bit numbers as strings."},
        {"license", {{"name", "Apache-2.0"}}}}},
      {"paths", std::move(paths)},
      {"components", {{"schemas", std::move(all)}}}};
  return description.dump() + "\n";
}

}  // namespace rigcal::server
