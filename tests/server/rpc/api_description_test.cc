// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/api_description.h"

#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "server/api/api_routes.h"
#include "server/rpc/api_messages.h"

namespace rigcal::testing::api_description_test {
namespace {

using Json = nlohmann::json;

Json Description() { return Json::parse(server::ApiDescription()); }

std::string Lower(std::string text) {
  std::ranges::transform(text, text.begin(), ::tolower);
  return text;
}

// Every "$ref" in it.
void CollectRefs(const Json& json, std::set<std::string>* refs) {
  if (json.is_object() && json.contains("$ref")) refs->insert(json["$ref"].get<std::string>());
  if (!json.is_structured()) return;
  for (const Json& part : json) CollectRefs(part, refs);
}

TEST(ApiDescription, HasEveryRouteWithWhatItTakes) {
  const Json description = Description();
  EXPECT_EQ(description["openapi"], "3.0.3");
  size_t operations = 0;
  for (const auto& [path, methods] : description["paths"].items()) operations += methods.size();
  EXPECT_EQ(operations, server::ApiRoutes().size());
  std::set<std::string> ids;
  for (const server::ApiRoute& route : server::ApiRoutes()) {
    const auto* method = server::FindMethod(route.rpc);
    ASSERT_NE(method, nullptr) << route.rpc;
    const Json& operation =
        description["paths"][std::string(route.path)][Lower(std::string(route.method))];
    EXPECT_TRUE(ids.insert(operation["operationId"].get<std::string>()).second)
        << operation["operationId"];
    EXPECT_EQ(operation.contains("requestBody"), route.HasBody());
    EXPECT_TRUE(operation["responses"].contains("200"));
    EXPECT_TRUE(operation["responses"].contains("default"));
    std::set<std::string> in_path;
    for (const Json& parameter : operation["parameters"]) {
      if (parameter["in"] == "path") in_path.insert(parameter["name"].get<std::string>());
      if (parameter["in"] != "header") {
        EXPECT_NE(method->input_type()->FindFieldByName(parameter["name"].get<std::string>()),
                  nullptr);
      }
    }
    const std::vector<std::string> variables = server::VariablesOf(route.path);
    EXPECT_EQ(in_path, std::set<std::string>(variables.begin(), variables.end())) << route.path;
  }
}

TEST(ApiDescription, EachReferenceLeadsToASchemaAndEachSchemaIsReached) {
  const Json description = Description();
  std::set<std::string> refs;
  CollectRefs(description, &refs);
  std::set<std::string> schemas;
  for (const auto& [name, schema] : description["components"]["schemas"].items()) {
    schemas.insert("#/components/schemas/" + name);
    EXPECT_TRUE(schema["type"] == "object" || schema["type"] == "string") << name;
  }
  EXPECT_EQ(refs, schemas);
  EXPECT_GT(schemas.size(), 80u);
}

TEST(ApiDescription, HasEveryFieldOfEveryMessage) {
  const Json schemas = Description()["components"]["schemas"];
  for (const auto& [name, schema] : schemas.items()) {
    const auto* type =
        google::protobuf::DescriptorPool::generated_pool()->FindMessageTypeByName(name);
    if (type == nullptr) continue;  // an enum, or Error
    EXPECT_EQ(schema["properties"].size(), static_cast<size_t>(type->field_count())) << name;
  }
}

}  // namespace
}  // namespace rigcal::testing::api_description_test
