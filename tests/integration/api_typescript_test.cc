// SPDX-License-Identifier: Apache-2.0
// The gRPC API of the real server, by TypeScript.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/integration/api_rig.h"

namespace rigcal::testing::api_typescript_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class ApiTypescript : public ApiRig {};

TEST_F(ApiTypescript, TheExampleCalibratesASession) {
  const std::filesystem::path folder = directory_.path() / "typescript";
  std::filesystem::create_directory(folder);
  for (const char* file : {"package.json", "package-lock.json", "tsconfig.json", "session.ts"}) {
    std::filesystem::copy_file(Examples() / "typescript" / file, folder / file);
  }
  const CommandResult packages = RunCommand(
      {"/bin/sh", "-c",
       "cd " + folder.string() + " && npm ci --no-audit --no-fund --prefer-offline 2>&1"});
  if (packages.exit_code != 0) {
    GTEST_SKIP() << "npm cannot install the packages of the example: " << packages.output;
  }
  const CommandResult result =
      RunCommand({"/bin/sh", "-c",
                  "cd " + folder.string() + " && npx tsc && node dist/session.js " +
                      server_->address() + " 3 " + RIGCAL_SOURCE_DIR + "/proto"});
  EXPECT_EQ(result.exit_code, 0) << result.output << result.error;
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("captures"), HasSubstr("STATE_SUCCEEDED"), HasSubstr("expected error")));
}

}  // namespace
}  // namespace rigcal::testing::api_typescript_test
