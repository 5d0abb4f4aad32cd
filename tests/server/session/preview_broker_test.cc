// SPDX-License-Identifier: Apache-2.0
#include "server/session/preview_broker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/server/session/session_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::preview_broker_test {
namespace {

using server::AgentDirectory;
using server::PreviewBroker;
using server::PreviewBrokerOptions;
using ::testing::AllOf;
using ::testing::HasSubstr;

// An agent that answers at once, in the thread that asks.
class AnsweringLink : public server::AgentLink {
 public:
  using OnRequest = std::function<void(const PreviewRequest&)>;
  explicit AnsweringLink(OnRequest on_request) : on_request_(std::move(on_request)) {}

  void SendStartCapture(const StartCaptureCommand&) override {}
  void SendStopCapture(const std::string&) override {}
  void SendPreviewRequest(const PreviewRequest& request) override { on_request_(request); }
  void SendDetectorRequest(const DetectorRequest&) override {}
  void SendChoiceRequest(const ChoiceRequest&) override {}
  void Close(const absl::Status&) override {}

 private:
  const OnRequest on_request_;
};

class PreviewBrokerTest : public ::testing::Test {
 protected:
  AgentDirectory::Registration Connect(const std::string& agent_id, const std::string& camera,
                                       AnsweringLink::OnRequest on_request,
                                       const std::string& rig = "rig") {
    AgentRecord agent = MakeAgent(agent_id, {camera});
    agent.rig = rig;
    auto registration = directory_.Register(std::move(agent),
                                            std::make_shared<AnsweringLink>(std::move(on_request)));
    EXPECT_THAT(registration.status(), IsOk());
    return registration.value_or(0);
  }
  // An agent with the camera "left" that answers with what `make` makes of the request.
  void ConnectAnswering(std::function<Preview(const PreviewRequest&)> make) {
    registration_ = Connect("pc", "left", [this, make](const PreviewRequest& request) {
      broker_.TakeAnswer(registration_, make(request));
    });
  }
  absl::StatusOr<PreviewBroker::CameraPreview> Get(const std::string& camera,
                                                   const std::string& rig = "") {
    return broker_.Get(rig, camera, std::chrono::milliseconds(0), [] { return false; });
  }
  static Preview Picture(const PreviewRequest& request) {
    Preview preview;
    preview.request_id = request.request_id;
    preview.info.camera = request.camera;
    preview.jpeg = "jpeg";
    return preview;
  }
  static PreviewBrokerOptions Options() {
    PreviewBrokerOptions options;
    options.max_jpeg_bytes = 1000;
    options.max_waiting = 2;
    return options;
  }

  AgentDirectory directory_;
  PreviewBroker broker_{Options(), &directory_};
  AgentDirectory::Registration registration_ = 0;
};

TEST_F(PreviewBrokerTest, BringsTheAgentsPicture) {
  PreviewRequest asked;
  ConnectAnswering([&](const PreviewRequest& request) {
    asked = request;
    return Picture(request);
  });
  ASSERT_OK_AND_ASSIGN(const PreviewBroker::CameraPreview first, Get("left"));
  EXPECT_EQ(first.agent_id, "pc");
  EXPECT_EQ(first.rig, "rig");
  EXPECT_EQ(first.preview.jpeg, "jpeg");
  EXPECT_EQ(asked.max_jpeg_bytes, 1000u);
  EXPECT_EQ(asked.max_wait_ms, 5000u);
  EXPECT_THAT(Get("left", "rig").status(), IsOk()) << "a second one after the first";
}

TEST_F(PreviewBrokerTest, NamesTheCamerasThereAre) {
  EXPECT_THAT(Get("left"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("no agent is connected")));
  ConnectAnswering(Picture);
  Connect(
      "other", "top", [](const PreviewRequest&) {}, "hall");
  EXPECT_THAT(Get("right"),
              StatusIs(absl::StatusCode::kNotFound,
                       AllOf(HasSubstr("'right'"), HasSubstr("rig/left"), HasSubstr("hall/top"))));
  EXPECT_THAT(Get("left", "hall"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("hall/left")));
}

TEST_F(PreviewBrokerTest, RefusesWhatCannotBeMeant) {
  EXPECT_THAT(Get(""), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("camera")));
  EXPECT_THAT(Get("../x"), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("camera")));
  ConnectAnswering(Picture);
  EXPECT_THAT(broker_.Get("", "left", std::chrono::hours(1), [] { return false; }),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("30000")));
  Connect(
      "other", "left", [](const PreviewRequest&) {}, "hall");
  EXPECT_THAT(Get("left"), StatusIs(absl::StatusCode::kInvalidArgument,
                                    AllOf(HasSubstr("hall"), HasSubstr("rig"))));
}

TEST_F(PreviewBrokerTest, SaysThatTheAgentIsAway) {
  ConnectAnswering(Picture);
  directory_.Unregister(registration_);
  EXPECT_THAT(Get("left"), StatusIs(absl::StatusCode::kFailedPrecondition,
                                    AllOf(HasSubstr("'pc'"), HasSubstr("not connected"))));
}

TEST_F(PreviewBrokerTest, PassesOnTheAgentsRefusals) {
  PreviewStatus answer = PreviewStatus::kOk;
  ConnectAnswering([&](const PreviewRequest& request) {
    Preview preview;
    preview.request_id = request.request_id;
    preview.status = answer;
    preview.message = "in the agent's words";
    return preview;
  });
  const std::vector<std::pair<PreviewStatus, absl::StatusCode>> cases = {
      {PreviewStatus::kDisabled, absl::StatusCode::kFailedPrecondition},
      {PreviewStatus::kUnknownCamera, absl::StatusCode::kNotFound},
      {PreviewStatus::kNoFrames, absl::StatusCode::kFailedPrecondition},
      {PreviewStatus::kNotCapturing, absl::StatusCode::kFailedPrecondition},
      {PreviewStatus::kTooOften, absl::StatusCode::kResourceExhausted},
      {PreviewStatus::kTimedOut, absl::StatusCode::kAborted},
      {PreviewStatus::kFailed, absl::StatusCode::kInternal}};
  for (const auto& [what, code] : cases) {
    answer = what;
    EXPECT_THAT(Get("left"), StatusIs(code, HasSubstr("in the agent's words")));
  }
}

TEST_F(PreviewBrokerTest, ChecksWhatTheAgentSends) {
  std::string camera = "right";
  std::string jpeg = "jpeg";
  ConnectAnswering([&](const PreviewRequest& request) {
    Preview preview = Picture(request);
    preview.info.camera = camera;
    preview.jpeg = jpeg;
    return preview;
  });
  EXPECT_THAT(Get("left"), StatusIs(absl::StatusCode::kInternal, HasSubstr("'right'")));
  camera = "left";
  jpeg = std::string(1001, 'j');
  EXPECT_THAT(Get("left"), StatusIs(absl::StatusCode::kInternal, HasSubstr("1001 bytes")));
}

TEST_F(PreviewBrokerTest, OneAtATimePerCameraAndAFewInAll) {
  // While the first request is under way others are made, from inside of it.
  Connect("b", "right", [&](const PreviewRequest&) {
    EXPECT_THAT(Get("left"), StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("rig/left")));
    EXPECT_THAT(Get("top"),
                StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("2 previews")));
    broker_.Shutdown();
  });
  Connect("c", "top", [](const PreviewRequest&) {});
  ConnectAnswering([&](const PreviewRequest& request) {
    EXPECT_THAT(Get("right"), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("shutting")));
    return Picture(request);
  });
  EXPECT_THAT(Get("left"), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("shutting")));
  EXPECT_THAT(Get("left"), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("shutting")));
}

TEST_F(PreviewBrokerTest, AnAnswerOfAnotherAgentIsNone) {
  registration_ = Connect("pc", "left", [this](const PreviewRequest& request) {
    broker_.TakeAnswer(registration_ + 1, Picture(request));
    Preview other = Picture(request);
    other.request_id += 7;
    broker_.TakeAnswer(registration_, other);
    broker_.AgentGone(registration_ + 1);
    broker_.AgentGone(registration_);
    broker_.TakeAnswer(registration_, Picture(request));
  });
  EXPECT_THAT(Get("left"), StatusIs(absl::StatusCode::kAborted, HasSubstr("disconnected")));
}

TEST_F(PreviewBrokerTest, EndsWhenNobodyWaitsOrNobodyAnswers) {
  Connect("pc", "left", [](const PreviewRequest&) {});
  EXPECT_THAT(broker_.Get("", "left", std::chrono::milliseconds(0), [] { return true; }).status(),
              StatusIs(absl::StatusCode::kCancelled, HasSubstr("nobody waits")));
  PreviewBrokerOptions hasty = Options();
  hasty.answer_grace = std::chrono::milliseconds(1);
  PreviewBroker broker(hasty, &directory_);
  EXPECT_THAT(broker.Get("", "left", std::chrono::milliseconds(1), [] { return false; }).status(),
              StatusIs(absl::StatusCode::kAborted, HasSubstr("did not answer")));
}

}  // namespace
}  // namespace rigcal::testing::preview_broker_test
