// SPDX-License-Identifier: Apache-2.0
#include "server/session/detector_broker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "tests/server/session/session_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::detector_broker_test {
namespace {

using server::AgentDirectory;
using server::DetectorBroker;
using ::testing::AllOf;
using ::testing::HasSubstr;

// An agent that answers at once, in the thread that asks.
class DetectorLink : public server::AgentLink {
 public:
  using OnRequest = std::function<void(const DetectorRequest&)>;
  explicit DetectorLink(OnRequest on_request) : on_request_(std::move(on_request)) {}

  void SendStartCapture(const StartCaptureCommand&) override {}
  void SendStopCapture(const std::string&) override {}
  void SendPreviewRequest(const PreviewRequest&) override {}
  void SendDetectorRequest(const DetectorRequest& request) override { on_request_(request); }
  void SendChoiceRequest(const ChoiceRequest&) override {}
  void Close(const absl::Status&) override {}

 private:
  const OnRequest on_request_;
};

class DetectorBrokerTest : public ::testing::Test {
 protected:
  void Connect(DetectorLink::OnRequest on_request) {
    ASSERT_OK_AND_ASSIGN(
        registration_, directory_.Register(MakeAgent("pc", {"left"}),
                                           std::make_shared<DetectorLink>(std::move(on_request))));
  }
  absl::StatusOr<DetectorBroker::CameraDetector> Ask(
      const std::string& camera, DetectorCommand command = DetectorCommand::kGet) {
    DetectorRequest request;
    request.camera = camera;
    request.command = command;
    return broker_.Ask("", request, [] { return false; });
  }

  AgentDirectory directory_;
  DetectorBroker broker_{{.max_waiting = 2, .longest_wait = std::chrono::milliseconds(20)},
                         &directory_};
  AgentDirectory::Registration registration_ = 0;
};

TEST_F(DetectorBrokerTest, BringsWhatTheAgentSays) {
  DetectorRequest asked;
  Connect([&](const DetectorRequest& request) {
    asked = request;
    DetectorAnswer answer{.request_id = request.request_id, .status = {}, .state = {}};
    answer.state.ignored_pixel_count = 7;
    broker_.TakeAnswer(registration_ + 1,
                       {.request_id = request.request_id, .status = {}, .state = {}});
    broker_.TakeAnswer(registration_, answer);
  });
  ASSERT_OK_AND_ASSIGN(const auto detector, Ask("left", DetectorCommand::kLearnMask));
  EXPECT_EQ(detector.agent_id, "pc");
  EXPECT_EQ(detector.rig, "rig");
  EXPECT_EQ(detector.state.ignored_pixel_count, 7u);
  EXPECT_EQ(asked.command, DetectorCommand::kLearnMask);
  EXPECT_GE(asked.request_id, 1u);
}

TEST_F(DetectorBrokerTest, RefusesUnknownCamerasAndAgentsThatAreAway) {
  Connect([](const DetectorRequest&) { ADD_FAILURE() << "it is asked"; });
  EXPECT_THAT(Ask("top"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("rig/left")));
  EXPECT_THAT(Ask("../x"), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("camera")));
  directory_.Unregister(registration_);
  EXPECT_THAT(Ask("left"), StatusIs(absl::StatusCode::kFailedPrecondition,
                                    AllOf(HasSubstr("'pc'"), HasSubstr("not connected"))));
}

TEST_F(DetectorBrokerTest, PassesOnTheAgentsRefusals) {
  Connect([&](const DetectorRequest& request) {
    broker_.TakeAnswer(registration_, {.request_id = request.request_id,
                                       .status = absl::FailedPreconditionError("it learns now"),
                                       .state = {}});
  });
  EXPECT_THAT(Ask("left"), StatusIs(absl::StatusCode::kFailedPrecondition, "it learns now"));
}

TEST_F(DetectorBrokerTest, EndsWithTheAgentOrWithoutAnAnswerOrWithTheServer) {
  Connect([&](const DetectorRequest&) { broker_.AgentGone(registration_); });
  EXPECT_THAT(Ask("left"), StatusIs(absl::StatusCode::kAborted, HasSubstr("disconnected")));
  directory_.Unregister(registration_);
  Connect([](const DetectorRequest&) {});
  EXPECT_THAT(Ask("left"), StatusIs(absl::StatusCode::kAborted, HasSubstr("update it")));
  directory_.Unregister(registration_);
  // Others may ask about the same camera, but not without end.
  int depth = 0;
  Connect([&](const DetectorRequest&) {
    if (++depth == 2) {
      EXPECT_THAT(Ask("left"),
                  StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("2 questions")));
      broker_.Shutdown();
      return;
    }
    EXPECT_THAT(Ask("left"), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("shutting")));
  });
  EXPECT_THAT(Ask("left"), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("shutting")));
}

}  // namespace
}  // namespace rigcal::testing::detector_broker_test
