// SPDX-License-Identifier: Apache-2.0
#include "server/session/calibration_input.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "tests/server/session/session_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::calibration_input_test {
namespace {

using ::testing::AllOf;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

Session Finished(const std::string& id, const std::vector<std::string>& cameras) {
  Session session = NewSession(id);
  session.state = SessionState::kFinished;
  for (const std::string& camera : cameras) session.cameras.push_back({MakeCamera(camera), "pc"});
  return session;
}

TEST(CheckSessionsFit, TakesSessionsOfOneRigAndTarget) {
  EXPECT_THAT(server::CheckSessionsFit(
                  {{Finished("one", {"left", "right"}), Finished("two", {"right", "top"})}}),
              IsOk());
}

TEST(CheckSessionsFit, TakesAWandWithARigidTargetAndAPoint) {
  Session board = Finished("two", {"left"}), point = Finished("three", {"left"});
  board.target = *ParseTarget("rigid:{a 0 0 0|b 1 0 0|c 0 1 0|d 1 1 0}");
  point.target = *ParseTarget("point");
  EXPECT_THAT(server::CheckSessionsFit({{Finished("one", {"left"}), board, point}}), IsOk());
}

TEST(CheckSessionsFit, WandsMayDiffer) {
  Session second = Finished("two", {"left"});
  second.target.marker_positions_m[1] = 0.2;
  EXPECT_THAT(server::CheckSessionsFit({{Finished("one", {"left"}), second}}), IsOk());
}

TEST(CheckSessionsFit, NamesBothThatDiffer) {
  const Session first = Finished("one", {"left"});
  const std::vector<std::pair<std::function<void(Session*)>, std::string>> cases = {
      {[](Session* session) { session->rig = "other"; }, "rig"},
      {[](Session* session) { session->cameras[0].description.intrinsics->fx_px = 900; }, "'left'"},
      {[](Session* session) { session->cameras[0].description.image_size_px.width = 640; },
       "'left'"},
  };
  for (const auto& [change, said] : cases) {
    Session second = Finished("two", {"left"});
    change(&second);
    EXPECT_THAT(server::CheckSessionsFit({{first, second}}),
                StatusIs(absl::StatusCode::kFailedPrecondition,
                         AllOf(HasSubstr("'one'"), HasSubstr("'two'"), HasSubstr(said))));
  }
}

TEST(CheckSessionsFit, ComparesSessionsThatBothFollowTheFirst) {
  Session third = Finished("three", {"top"});
  third.cameras[0].description.intrinsics->cx_px = 1;
  EXPECT_THAT(
      server::CheckSessionsFit({{Finished("one", {"left"}), Finished("two", {"top"}), third}}),
      StatusIs(absl::StatusCode::kFailedPrecondition,
               AllOf(HasSubstr("'two'"), HasSubstr("'three'"), HasSubstr("'top'"))));
}

TEST(CheckSessionsFit, NamesSessionsThatHaveNotFinished) {
  for (const SessionState state :
       {SessionState::kCreated, SessionState::kCapturing, SessionState::kDraining}) {
    Session session = Finished("wave", {"left"});
    session.state = state;
    EXPECT_THAT(server::CheckSessionsFit({{session}}),
                StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("'wave'")));
  }
}

TEST(CheckSessionsFit, NamesCamerasWithoutIntrinsics) {
  Session session = Finished("wave", {"left", "right"});
  session.cameras[1].description.intrinsics.reset();
  EXPECT_THAT(server::CheckSessionsFit({{session}}),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("'right'"), HasSubstr("intrinsics"))));
}

TEST(CheckSessionsFit, LensesThatAreGivenCount) {
  Session session = Finished("wave", {"left", "right", "top"});
  session.target = *ParseTarget("board:checker,9x6,0.03");
  session.cameras[1].description.intrinsics.reset();
  session.cameras[2].description.intrinsics.reset();
  CalibrationOptions options;
  EXPECT_THAT(server::CheckSessionsFit({{session}}, options),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("cameras 'right', 'top' of session 'wave' have no lens"),
                             HasSubstr("page Lens"), HasSubstr("rigcal lens use wave"))));
  options.given_intrinsics.push_back({"right", {1280, 1024}, *MakeCamera("right").intrinsics});
  EXPECT_THAT(server::CheckSessionsFit({{session}}, options),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       HasSubstr("camera 'top' of session 'wave' has no lens")));
  options.without_cameras = {"top"};
  EXPECT_THAT(server::CheckSessionsFit({{session}}, options), IsOk());
  // Recorded again with the lens in its agent.
  Session again = Finished("again", {"right"});
  again.target = session.target;
  EXPECT_THAT(server::CheckSessionsFit({{session, again}}, options), IsOk());
}

class ReadCalibrationInput : public SessionFixture {
 protected:
  absl::StatusOr<server::CalibrationInput> Read(const std::vector<std::string>& ids,
                                                size_t max_observations = 1000) {
    refused_ = {};
    return server::ReadCalibrationInput(faulty(), ids, max_observations, cancelled_, &refused_);
  }

  std::atomic<bool> cancelled_ = false;
  RefusalCounter refused_;
};

TEST_F(ReadCalibrationInput, GivesEveryRowOfEveryCamera) {
  FinishByHand("wave", {"left", "right"}, 20);
  ASSERT_OK_AND_ASSIGN(const server::CalibrationInput input, Read({"wave"}));
  EXPECT_EQ(input.target, NewSession("").target);
  ASSERT_THAT(input.tracks, SizeIs(2));
  EXPECT_EQ(input.tracks[0].camera, MakeCamera("left"));
  EXPECT_EQ(input.tracks[0].session_id, "wave");
  EXPECT_THAT(input.tracks[0].observations, SizeIs(20));
  const Observation expected = MakeBatch({"wave", "left", 1}, 1, 20).Row(6);
  EXPECT_EQ(input.tracks[0].observations[6].time_ns, expected.time_ns);
  EXPECT_EQ(input.tracks[0].observations[6].markers[1].centre_px, expected.markers[1].centre_px);
  EXPECT_THAT(input.refused, IsEmpty());
}

TEST_F(ReadCalibrationInput, CountsLateRowsInsteadOfUsingThem) {
  FinishByHand("wave", {"left", "right"}, 20);
  // A new stream epoch, after the end.
  Deliver({"wave", "right", 2}, 1, 7);
  ASSERT_OK_AND_ASSIGN(const server::CalibrationInput input, Read({"wave"}));
  EXPECT_THAT(input.tracks[1].observations, SizeIs(20));
  ASSERT_THAT(input.refused, SizeIs(1));
  EXPECT_EQ(input.refused[0].camera, "right");
  EXPECT_EQ(input.refused[0].reason, RefusalReason::kLate);
  EXPECT_EQ(input.refused[0].count, 7u);
}

TEST_F(ReadCalibrationInput, CountsWhatOfEachCameraIsRead) {
  FinishByHand("wave", {"left", "right"}, 20);
  Deliver({"wave", "right", 2}, 1, 7);  // late, and without an end
  std::vector<server::RowShare> shares;
  ASSERT_THAT(
      server::ReadCalibrationInput(faulty(), {{"wave"}}, 1000, cancelled_, &refused_, &shares),
      IsOk());
  ASSERT_THAT(shares, SizeIs(2));
  EXPECT_EQ(shares[0].camera(), "left");
  EXPECT_EQ(shares[0].session_id(), "wave");
  EXPECT_EQ(shares[0].detected(), 20u);
  EXPECT_EQ(shares[0].read(), 20u);
  EXPECT_FALSE(shares[0].has_open_stream());
  EXPECT_NEAR(shares[0].span_s(), 0.19, 1e-9);
  EXPECT_EQ(shares[1].detected(), 27u);
  EXPECT_EQ(shares[1].read(), 20u);
  EXPECT_EQ(shares[1].late(), 7u);
  EXPECT_TRUE(shares[1].has_open_stream());
}

TEST_F(ReadCalibrationInput, LeavesRefusedRowsOutAndCarriesTheirCount) {
  StartByHand("wave", {"left"});
  server::Delivery delivery = MakeDelivery(MakeBatch({"wave", "left", 1}, 1, 10));
  delivery.refused_rows = {
      {.row = 3, .reason = RefusalReason::kNotFinite, .detail = "x is not finite"}};
  Append(delivery);
  DeliverEnd({"wave", "left", 1}, 10);
  AwaitFinished("wave");
  ASSERT_OK_AND_ASSIGN(const server::CalibrationInput input, Read({"wave"}));
  ASSERT_THAT(input.tracks[0].observations, SizeIs(9));
  const int64_t refused_time = MakeBatch({"wave", "left", 1}, 1, 10).time_ns[3];
  EXPECT_THAT(input.tracks[0].observations,
              Each(Field(&Observation::time_ns, ::testing::Ne(refused_time))));
  ASSERT_THAT(input.refused, SizeIs(1));
  EXPECT_EQ(input.refused[0].camera, "left");
  EXPECT_EQ(input.refused[0].reason, RefusalReason::kNotFinite);
  EXPECT_EQ(input.refused[0].count, 1u);
}

TEST_F(ReadCalibrationInput, CarriesClockSamplesWithTheirEpoch) {
  StartByHand("wave", {"left"});
  ObservationBatch batch = MakeBatch({"wave", "left", 1}, 1, 3, /*clock_epoch=*/2);
  batch.clock_samples = {
      {.device_ns = 1, .host_monotonic_ns = 2, .host_utc_ns = 3, .uncertainty_ns = 4}};
  batch.host_alignments = {
      {.host_monotonic_ns = 5, .server_minus_host_ns = 6, .uncertainty_ns = 7}};
  Append(batch);
  DeliverEnd({"wave", "left", 1}, 3);
  AwaitFinished("wave");
  ASSERT_OK_AND_ASSIGN(const server::CalibrationInput input, Read({"wave"}));
  ASSERT_THAT(input.tracks[0].clock_samples, SizeIs(1));
  EXPECT_EQ(input.tracks[0].clock_samples[0].clock_epoch, 2u);
  EXPECT_EQ(input.tracks[0].clock_samples[0].sample, batch.clock_samples[0]);
  EXPECT_THAT(input.tracks[0].host_alignments, ElementsAre(batch.host_alignments[0]));
}

TEST_F(ReadCalibrationInput, KeepsSessionsApartAndCamerasWithoutRows) {
  FinishByHand("one", {"left", "right"}, 5);
  FinishByHand("two", {"left"}, 0);
  ASSERT_OK_AND_ASSIGN(const server::CalibrationInput input, Read({"one", "two"}));
  ASSERT_THAT(input.tracks, SizeIs(3));
  EXPECT_EQ(input.tracks[2].session_id, "two");
  EXPECT_THAT(input.tracks[2].observations, IsEmpty());
}

TEST_F(ReadCalibrationInput, StopsAtTheLimitOnCancellationAndOnErrors) {
  FinishByHand("wave", {"left"}, 20);
  EXPECT_THAT(Read({"wave"}, 19),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("19 observations")));
  EXPECT_THAT(Read({"wave"}, 20), IsOk());
  cancelled_ = true;
  EXPECT_THAT(Read({"wave"}), StatusIs(absl::StatusCode::kCancelled, HasSubstr("cancelled")));
  cancelled_ = false;
  faulty().Fail("ReadObservations", absl::DataLossError("checksum of batch 3"));
  EXPECT_THAT(Read({"wave"}), StatusIs(absl::StatusCode::kDataLoss, HasSubstr("batch 3")));
  EXPECT_THAT(Read({"nobody"}), StatusIs(absl::StatusCode::kNotFound, HasSubstr("nobody")));
}

}  // namespace
}  // namespace rigcal::testing::calibration_input_test
