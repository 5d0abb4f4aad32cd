// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/gige_controller.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "agent/capture/genicam/aravis_camera.h"
#include "tests/testing/fake_gige_camera.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::gige_controller_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

constexpr std::chrono::milliseconds kLimit(2000);

TEST(GigeController, IsNobodyUntilAProgramOpensTheCamera) {
  ASSERT_OK_AND_ASSIGN(const auto fake, testing::FakeGigeCamera::Create({}));
  ASSERT_OK_AND_ASSIGN(const auto before, GigeControllerOf("127.0.0.1", "lo", kLimit));
  EXPECT_EQ(before, std::nullopt);
  {
    AravisSourceOptions options;
    options.camera = "left";
    options.device = "127.0.0.1";
    ASSERT_OK_AND_ASSIGN(const auto camera, AravisCamera::Open(options, false));
    ASSERT_OK_AND_ASSIGN(const auto during, GigeControllerOf("127.0.0.1", "lo", kLimit));
    EXPECT_NE(during, std::nullopt);
  }
  ASSERT_OK_AND_ASSIGN(const auto after, GigeControllerOf("127.0.0.1", "lo", kLimit));
  EXPECT_EQ(after, std::nullopt);
}

TEST(GigeController, SaysThatNobodyAnswers) {
  EXPECT_THAT(GigeControllerOf("127.0.0.77", "lo", std::chrono::milliseconds(200)),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("127.0.0.77")));
  EXPECT_THAT(GigeControllerOf("240.1.2.3", "lo", kLimit),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("240.1.2.3")));
  EXPECT_THAT(GigeControllerOf("left", "", kLimit),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("left")));
}

}  // namespace
}  // namespace rigcal::agent::gige_controller_test
