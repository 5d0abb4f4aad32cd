// SPDX-License-Identifier: Apache-2.0
// The program that ships describes every service that it lists: tools such as `buf curl` need that.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <regex>
#include <string>
#include <vector>

#include "tests/testing/process.h"
#include "tests/testing/reflection_client.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::reflection_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsSupersetOf;
using ::testing::Not;

class Reflection : public ::testing::Test {
 protected:
  std::string Ask(const std::string& request) { return Reflect(channel_, request); }
  std::vector<std::string> Services() {
    const std::string answer = Ask("list_services: ''");
    const std::regex name(R"(name: \"([^"]+)\")");
    std::vector<std::string> services;
    for (auto it = std::sregex_iterator(answer.begin(), answer.end(), name);
         it != std::sregex_iterator(); ++it) {
      services.push_back((*it)[1]);
    }
    return services;
  }

  const TemporaryDirectory directory_;
  ServerProcess server_{directory_.path() / "store"};
  const std::shared_ptr<grpc::Channel> channel_ =
      grpc::CreateChannel(server_.address(), grpc::InsecureChannelCredentials());
};

TEST_F(Reflection, EveryListedServiceIsDescribed) {
  const std::vector<std::string> services = Services();
  EXPECT_THAT(services, IsSupersetOf({"rigcal.v1.AgentService", "rigcal.v1.CalibrationService",
                                      "rigcal.v1.CameraService", "rigcal.v1.IdentityService",
                                      "rigcal.v1.IngestService", "rigcal.v1.MaintenanceService",
                                      "rigcal.v1.RigService", "rigcal.v1.SessionService",
                                      "rigcal.v1.StatusService", "grpc.health.v1.Health"}));
  for (const std::string& service : services) {
    EXPECT_THAT(Ask("file_containing_symbol: '" + service + "'"),
                AllOf(HasSubstr("file_descriptor_proto"), Not(HasSubstr("error_response {"))))
        << service;
  }
  EXPECT_THAT(Ask("file_containing_symbol: 'rigcal.v1.Nobody'"), HasSubstr("error_response {"));
}

}  // namespace
}  // namespace rigcal::testing::reflection_test
