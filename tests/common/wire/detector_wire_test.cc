// SPDX-License-Identifier: Apache-2.0
#include "common/wire/detector_wire.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/testing/status_matchers.h"

namespace rigcal::testing::detector_wire_test {
namespace {

using ::testing::HasSubstr;

DetectorAnswer Answer() {
  DetectorAnswer answer{.request_id = 7, .status = {}, .state = {}};
  answer.state = {.colour = {.hue_min_deg = 340, .hue_max_deg = 20.5, .value_min = 90},
                  .colour_learnt = true,
                  .mask_learnt = true,
                  .ignored_pixel_count = 120,
                  .ignored_share = 0.25,
                  .learning = DetectorLearning{.kind = DetectorLearning::Kind::kColour,
                                               .state = DetectorLearning::State::kFailed,
                                               .frame_count = 3,
                                               .wanted_frame_count = 50,
                                               .wand_count = 2,
                                               .message = "no"}};
  return answer;
}

TEST(DetectorWire, BringsAnswersAcross) {
  ASSERT_OK_AND_ASSIGN(const DetectorAnswer same, wire::FromProto(wire::ToProto(Answer())));
  EXPECT_EQ(same.request_id, 7u);
  EXPECT_THAT(same.status, IsOk());
  EXPECT_EQ(same.state, Answer().state);
  for (const absl::Status& refusal : {absl::NotFoundError("a"), absl::FailedPreconditionError("b"),
                                      absl::InvalidArgumentError("c"), absl::InternalError("d")}) {
    ASSERT_OK_AND_ASSIGN(
        const DetectorAnswer refused,
        wire::FromProto(wire::ToProto({.request_id = 8, .status = refusal, .state = {}})));
    EXPECT_EQ(refused.status, refusal);
  }
}

TEST(DetectorWire, BringsRequestsAcross) {
  DetectorRequest request{.request_id = 3,
                          .camera = "left",
                          .command = DetectorCommand::kSetColour,
                          .frame_count = 9,
                          .colour = ColourRange{.washed_out_min = 256}};
  ASSERT_OK_AND_ASSIGN(const DetectorRequest same, wire::FromProto(wire::ToProto(request)));
  EXPECT_EQ(same.camera, "left");
  EXPECT_EQ(same.command, DetectorCommand::kSetColour);
  EXPECT_EQ(same.frame_count, 9u);
  EXPECT_EQ(same.colour, request.colour);
}

TEST(DetectorWire, NamesWhatCannotBe) {
  const auto refused = [](const auto& message, const std::string& what) {
    EXPECT_THAT(wire::FromProto(message),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(what)));
  };
  v1::DetectorRequest request;
  refused(request, "request_id");
  request.set_request_id(1);
  refused(request, "detector_request.camera");
  request.set_camera("left");
  refused(request, "detector_request.command");
  request.set_command(v1::DETECTOR_COMMAND_SET_COLOUR);
  request.mutable_colour()->set_value_min(4'000'000'000);
  refused(request, "value_min is 1000000");

  const v1::DetectorAnswer good = wire::ToProto(Answer());
  refused(v1::DetectorAnswer(), "request_id");
  v1::DetectorAnswer answer = good;
  answer.mutable_detector()->mutable_colour()->set_hue_max_deg(-1);
  refused(answer, "detector_answer.detector.colour");
  answer = good;
  answer.mutable_detector()->set_ignored_share(1.5);
  refused(answer, "ignored_share");
  answer = good;
  answer.mutable_detector()->mutable_learning()->clear_kind();
  refused(answer, "learning.kind");
  answer = good;
  answer.mutable_detector()->mutable_learning()->set_state(
      static_cast<v1::DetectorLearning::State>(9));
  refused(answer, "learning.state");
}

TEST(DetectorWire, TakesAStatusOfANewerAgentAndCutsLongTexts) {
  v1::DetectorAnswer answer;
  answer.set_request_id(1);
  answer.set_status(static_cast<v1::DetectorStatus>(77));
  answer.set_message(std::string(5000, 'x'));
  ASSERT_OK_AND_ASSIGN(const DetectorAnswer taken, wire::FromProto(answer));
  EXPECT_EQ(taken.status.code(), absl::StatusCode::kInternal);
  EXPECT_EQ(taken.status.message().size(), 1024u);
}

}  // namespace
}  // namespace rigcal::testing::detector_wire_test
