// SPDX-License-Identifier: Apache-2.0
// The JSON API of the real server, by curl.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/integration/api_rig.h"

namespace rigcal::testing::api_curl_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class ApiCurl : public ApiRig {
 protected:
  void SetUp() override {
    if (RunCommand({"/bin/sh", "-c", "command -v curl"}).exit_code != 0) {
      GTEST_SKIP() << "curl is not installed";
    }
    ApiRig::SetUp();
  }
};

TEST_F(ApiCurl, TheExampleCalibratesASession) {
  const CommandResult result =
      RunCommand({"/bin/bash", (Examples() / "session.sh").string(), url(), "3"});
  EXPECT_EQ(result.exit_code, 0) << result.output << result.error;
  EXPECT_THAT(result.output, AllOf(HasSubstr("STATE_CAPTURING"), HasSubstr("STATE_FINISHED"),
                                   HasSubstr("STATE_SUCCEEDED"), HasSubstr("used_mean_px")));
  // Somebody else may look at it by gRPC.
  const auto session = ServerClient(server_->address()).GetSession("s-000001");
  ASSERT_TRUE(session.ok()) << session.status();
  EXPECT_EQ(session->title(), "by curl");
}

TEST_F(ApiCurl, TheExampleSaysWhyItIsRefused) {
  agent_.reset();
  ASSERT_TRUE(WaitFor([&] {
    const auto agents = ServerClient(server_->address()).ListAgents();
    return agents.ok() && agents->size() == 1 && !agents->at(0).connected();
  }));
  const CommandResult result = RunCommand(
      {"/bin/sh", "-c",
       "curl -s -X POST -H 'X-Rigcal: 1' -d '{\"id\": \"s\", \"target\": {\"kind\": \"KIND_WAND\", "
       "\"marker_positions_m\": [0, 0.13, 0.39]}}' " +
           url() + "/v1/sessions; curl -s -w '%{http_code}' -X POST -H 'X-Rigcal: 1' " + url() +
           "/v1/sessions/s:start"});
  EXPECT_THAT(result.output, AllOf(HasSubstr("STATE_CREATED"), HasSubstr("FAILED_PRECONDITION"),
                                   HasSubstr("409")));
}

TEST_F(ApiCurl, ShowsMetricsAndItsDescription) {
  const CommandResult result = RunCommand(
      {"/bin/sh", "-c", "curl -s " + url() + "/metrics; curl -s " + url() + "/v1/openapi.json"});
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("rigcal_agents_connected 1\n"), HasSubstr("\"openapi\":\"3.0.3\"")));
}

}  // namespace
}  // namespace rigcal::testing::api_curl_test
