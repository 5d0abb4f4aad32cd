// SPDX-License-Identifier: Apache-2.0
#include "client/commands/camera_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/client/command_runner.h"
#include "tests/client/fake_server.h"

namespace rigcal::client::camera_command_test {
namespace {

using ::rigcal::testing::CommandOutcome;
using ::rigcal::testing::FakeServer;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class CameraDetectorCommands : public ::testing::Test {
 protected:
  CameraDetectorCommands() {
    fake_.detector.set_agent_id("pc");
    fake_.detector.set_rig("lab");
    v1::Detector* const detector = fake_.detector.mutable_detector();
    detector->mutable_colour()->set_hue_max_deg(50);
    detector->mutable_colour()->set_value_min(60);
    detector->mutable_colour()->set_washed_out_min(250);
    detector->set_mask_learnt(true);
    detector->set_ignored_pixel_count(120);
  }
  CommandOutcome Camera(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "camera");
    arguments.insert(arguments.end(), {"--server", fake_.address()});
    return rigcal::testing::Rigcal(arguments);
  }
  // It learns for two questions, then ends so.
  void Learn(v1::DetectorLearning::Kind kind, v1::DetectorLearning::State end,
             const std::string& message) {
    fake_.on_get_detector = [=, asked = 0](v1::Detector& detector) mutable {
      v1::DetectorLearning* const learning = detector.mutable_learning();
      learning->set_kind(kind);
      learning->set_state(++asked < 3 ? v1::DetectorLearning::STATE_RUNNING : end);
      learning->set_message(message);
    };
  }

  FakeServer fake_;
};

TEST_F(CameraDetectorCommands, ShowsTheDetector) {
  const CommandOutcome outcome = Camera({"detector", "left"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("lab/left at agent pc"), HasSubstr("hue 0 to 50 deg"),
                                 HasSubstr("120 pixels"), HasSubstr("with a learnt mask")));
}

TEST_F(CameraDetectorCommands, LearnsAMaskAndWaits) {
  Learn(v1::DetectorLearning::KIND_MASK, v1::DetectorLearning::STATE_SUCCEEDED, "120 pixels less");
  const CommandOutcome outcome = Camera({"mask", "left", "--rig", "lab", "--frames", "30"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("last learnt: mask, 120 pixels less"));
  EXPECT_EQ(fake_.asked_mask.rig(), "lab");
  EXPECT_EQ(fake_.asked_mask.frame_count(), 30u);
}

TEST_F(CameraDetectorCommands, FailsWhereNothingIsLearnt) {
  Learn(v1::DetectorLearning::KIND_COLOUR, v1::DetectorLearning::STATE_FAILED, "no wand\x1b[2J");
  CommandOutcome outcome = Camera({"tune", "left"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.out, IsEmpty());
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("camera left: no wand"), Not(HasSubstr("\x1b"))));
  fake_.failures["LearnMask"] = {grpc::StatusCode::FAILED_PRECONDITION, "only while a session"};
  outcome = Camera({"mask", "left"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("only while a session"));
}

TEST_F(CameraDetectorCommands, ClearsAMask) {
  const CommandOutcome outcome = Camera({"mask", "left", "--clear", "-o", "json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_FALSE(nlohmann::json::parse(outcome.out).at("detector").at("mask_learnt").get<bool>());
}

TEST_F(CameraDetectorCommands, ChangesWhatIsGivenOfAColour) {
  CommandOutcome outcome = Camera({"colour", "left", "--value-min", "90", "--hue-min", "340"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(fake_.asked_colour.colour().value_min(), 90u);
  EXPECT_EQ(fake_.asked_colour.colour().hue_min_deg(), 340);
  EXPECT_EQ(fake_.asked_colour.colour().hue_max_deg(), 50);
  EXPECT_EQ(fake_.asked_colour.colour().washed_out_min(), 250u);
  outcome = Camera({"colour", "left", "--reset"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_FALSE(fake_.asked_colour.has_colour());
  EXPECT_EQ(Camera({"colour", "left", "--value-min", "bright"}).exit_code, 2);
}

}  // namespace
}  // namespace rigcal::client::camera_command_test
