// SPDX-License-Identifier: Apache-2.0
#include "agent/uplink/capture_control.h"

#include <memory>
#include <vector>

#include "agent/spool/memory_spool.h"
#include "tests/agent/uplink/scripted_source.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::capture_control_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<std::unique_ptr<ObservationSource>> Sources(const std::vector<std::string>& cameras) {
  std::vector<std::unique_ptr<ObservationSource>> sources;
  for (const std::string& camera : cameras) {
    sources.push_back(std::make_unique<ScriptedSource>(camera));
  }
  return sources;
}

TEST(CaptureControl, RefusesNoCameraAndTwoOfOneName) {
  MemorySpool spool;
  EXPECT_THAT(CaptureControl::Create({}, &spool, [] {}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("--source")));
  EXPECT_THAT(CaptureControl::Create(Sources({"a", "b", "a"}), &spool, [] {}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("two cameras are named a")));
}

TEST(CaptureControl, RunsSeveralCamerasSideBySide) {
  MemorySpool spool;
  ASSERT_OK_AND_ASSIGN(auto control, CaptureControl::Create(Sources({"b", "a"}), &spool, [] {}));
  control->Start();
  ASSERT_EQ(control->cameras().size(), 2u);
  EXPECT_EQ(control->cameras()[0].camera, "a");
  ASSERT_THAT(control->Begin({"s-1", "a", 1}, MakeTarget(), 1), IsOk());
  ASSERT_THAT(control->Begin({"s-1", "b", 1}, MakeTarget(), 1), IsOk());
  EXPECT_THAT(control->SessionsOf("a"), ElementsAre("s-1"));
  EXPECT_THAT(control->SessionsOf("nobody"), IsEmpty());
  EXPECT_THAT(control->Begin({"s-1", "c", 1}, MakeTarget(), 1),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("no camera c")));
  control->EndStream({"s-1", "a", 1});
  EXPECT_THAT(control->SessionsOf("a"), IsEmpty());
  EXPECT_THAT(control->SessionsOf("b"), ElementsAre("s-1"));
  control->End("s-1");
  control->Shutdown();
  for (const SpooledStream& spooled : spool.Streams()) EXPECT_TRUE(spooled.end.has_value());
}

}  // namespace
}  // namespace rigcal::agent::capture_control_test
