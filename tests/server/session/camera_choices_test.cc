// SPDX-License-Identifier: Apache-2.0
#include "server/session/camera_choices.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "tests/server/session/session_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::camera_choices_test {
namespace {

using server::AgentDirectory;
using server::AgentRegistry;
using server::CameraChoices;
using ::testing::AllOf;
using ::testing::HasSubstr;

// An agent that answers at once, in the thread that asks.
class ChoosingLink : public server::AgentLink {
 public:
  using OnRequest = std::function<void(const ChoiceRequest&)>;
  explicit ChoosingLink(OnRequest on_request) : on_request_(std::move(on_request)) {}

  void SendStartCapture(const StartCaptureCommand&) override {}
  void SendStopCapture(const std::string&) override {}
  void SendPreviewRequest(const PreviewRequest&) override {}
  void SendDetectorRequest(const DetectorRequest&) override {}
  void SendChoiceRequest(const ChoiceRequest& request) override { on_request_(request); }
  void Close(const absl::Status&) override {}

 private:
  const OnRequest on_request_;
};

class CameraChoicesTest : public ::testing::Test {
 protected:
  AgentDirectory::Registration Connect(const std::string& agent,
                                       const std::vector<std::string>& cameras,
                                       ChoosingLink::OnRequest on_request) {
    const auto registration = directory_.Register(
        MakeAgent(agent, cameras), std::make_shared<ChoosingLink>(std::move(on_request)));
    EXPECT_TRUE(registration.ok()) << registration.status();
    return registration.value_or(0);
  }
  // Says yes, and keeps what was asked.
  AgentDirectory::Registration Connect(const std::string& agent,
                                       const std::vector<std::string>& cameras = {}) {
    const auto number = std::make_shared<AgentDirectory::Registration>(0);
    *number = Connect(agent, cameras, [this, number](const ChoiceRequest& request) {
      asked_ = request;
      choices_.TakeAnswer(*number, {.request_id = request.request_id, .status = answer_});
    });
    return *number;
  }
  void Offer(AgentDirectory::Registration registration, const std::string& agent,
             std::vector<OfferedCamera> cameras) {
    choices_.TakeOffer(registration, agent, std::move(cameras));
  }
  static OfferedCamera Camera(const std::string& device, const std::string& name = "") {
    return {.device = device,
            .kind = "aravis",
            .use = name.empty() ? OfferedCamera::Use::kFree : OfferedCamera::Use::kTakesPart,
            .camera = name};
  }
  absl::StatusOr<CameraChoices::Chosen> Use(const std::string& agent, const std::string& device,
                                            const std::string& camera) {
    return choices_.Use(agent, {.device = device, .camera = camera, .calibration_yaml = "lens"},
                        [] { return false; });
  }
  absl::StatusOr<CameraChoices::Chosen> Drop(const std::string& rig, const std::string& camera) {
    return choices_.Drop(rig, camera, [] { return false; });
  }

  AgentDirectory directory_;
  std::unique_ptr<AgentRegistry> registry_ = *AgentRegistry::Open({});
  CameraChoices choices_{{.max_waiting = 2, .longest_wait = std::chrono::milliseconds(20)},
                         &directory_,
                         registry_.get()};
  ChoiceRequest asked_;
  absl::Status answer_;
};

TEST_F(CameraChoicesTest, AsksTheAgentThatOffersTheDevice) {
  const auto first = Connect("pc-1");
  const auto second = Connect("pc-2");
  Offer(first, "pc-1", {Camera("1")});
  Offer(second, "pc-2", {Camera("2"), Camera("3")});
  ASSERT_OK_AND_ASSIGN(const auto chosen, Use("", "3", "left"));
  EXPECT_EQ(chosen.agent_id, "pc-2");
  EXPECT_EQ(chosen.rig, "rig");
  EXPECT_EQ(asked_.device, "3");
  EXPECT_EQ(asked_.camera, "left");
  EXPECT_EQ(asked_.calibration_yaml, "lens");
  EXPECT_GE(asked_.request_id, 1u);
  Offer(second, "pc-2", {Camera("2"), Camera("3", "left")});
  ASSERT_OK_AND_ASSIGN(const auto dropped, Drop("", "left"));
  EXPECT_EQ(dropped.agent_id, "pc-2");
  EXPECT_EQ(asked_.device, "");
  EXPECT_EQ(asked_.camera, "left");
}

TEST_F(CameraChoicesTest, RefusesWhatNobodyOffersAndNamesWhatThereIs) {
  EXPECT_THAT(Use("", "1", "left"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("none is offered")));
  const auto first = Connect("pc-1");
  const auto second = Connect("pc-2");
  Offer(first, "pc-1", {Camera("1"), Camera("2")});
  Offer(second, "pc-2", {Camera("1")});
  EXPECT_THAT(Use("", "9\n", "left"),
              StatusIs(absl::StatusCode::kNotFound,
                       AllOf(HasSubstr("'9\\n'"), HasSubstr("pc-1/1, pc-1/2, pc-2/1"))));
  EXPECT_THAT(Use("pc-2", "2", "left"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("it offers 1")));
  EXPECT_THAT(Use("", "1", "left"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("pc-1, pc-2")));
  EXPECT_THAT(Use("pc-3", "1", "left"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("not connected")));
  EXPECT_THAT(Use("", "1", "a/b"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("camera")));
  EXPECT_THAT(Use("", "", "left"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("device")));
  EXPECT_THAT(Drop("", "left"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("'left'")));
}

TEST_F(CameraChoicesTest, RefusesTheNameOfACameraOfAnotherAgent) {
  Connect("pc-1", {"left"});
  const auto second = Connect("pc-2");
  Offer(second, "pc-2", {Camera("1")});
  EXPECT_THAT(Use("pc-2", "1", "left"),
              StatusIs(absl::StatusCode::kAlreadyExists,
                       AllOf(HasSubstr("'pc-1'"), HasSubstr("rigcal camera move left pc-2"))));
  // Also one of an agent that is away.
  ASSERT_TRUE(registry_->Move("rig", "top", "pc-7").ok());
  EXPECT_THAT(Use("pc-2", "1", "top"),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("'pc-7'")));
}

TEST_F(CameraChoicesTest, PassesOnTheAgentsRefusalsAndDoesNotWaitForEver) {
  const auto first = Connect("pc-1");
  Offer(first, "pc-1", {Camera("1")});
  answer_ = absl::FailedPreconditionError("in use by a program at 10.0.0.3");
  EXPECT_THAT(Use("", "1", "left"),
              StatusIs(absl::StatusCode::kFailedPrecondition, "in use by a program at 10.0.0.3"));
  directory_.Unregister(first);
  choices_.AgentGone(first);
  const auto again = Connect("pc-1", {}, [](const ChoiceRequest&) {});
  Offer(again, "pc-1", {Camera("1")});
  EXPECT_THAT(Use("", "1", "left"), StatusIs(absl::StatusCode::kAborted, HasSubstr("answer")));
}

TEST_F(CameraChoicesTest, ForgetsTheOffersOfAnAgentThatIsGone) {
  const auto first = Connect("pc-1");
  Offer(first, "pc-1", {Camera("1")});
  EXPECT_EQ(choices_.OffersOf("pc-1").size(), 1u);
  // A stream that another one has replaced ends later than that one begins.
  const auto second = first + 1;
  Offer(second, "pc-1", {Camera("1"), Camera("2")});
  choices_.AgentGone(first);
  Offer(first, "pc-1", {});
  EXPECT_EQ(choices_.OffersOf("pc-1").size(), 2u);
  choices_.AgentGone(second);
  EXPECT_TRUE(choices_.OffersOf("pc-1").empty());
}

TEST_F(CameraChoicesTest, DropsOfOneRigWhereTwoHaveTheName) {
  const auto first = Connect("pc-1");
  AgentRecord other = MakeAgent("pc-2", {});
  other.rig = "lab";
  ASSERT_OK_AND_ASSIGN(
      const auto second,
      directory_.Register(other, std::make_shared<ChoosingLink>([](const ChoiceRequest&) {})));
  Offer(first, "pc-1", {Camera("1", "left")});
  Offer(second, "pc-2", {Camera("2", "left")});
  EXPECT_THAT(Drop("", "left"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("name the rig")));
  ASSERT_OK_AND_ASSIGN(const auto dropped, Drop("rig", "left"));
  EXPECT_EQ(dropped.agent_id, "pc-1");
}

}  // namespace
}  // namespace rigcal::testing::camera_choices_test
