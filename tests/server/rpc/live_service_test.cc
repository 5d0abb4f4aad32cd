// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <grpcpp/impl/rpc_method.h>
#include <gtest/gtest.h>

#include <string>

#include "common/wire/session_wire.h"
#include "rigcal/v1/live_service.grpc.pb.h"
#include "server/rpc/live_answers.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::live_service_test {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class LiveService : public RpcFixture {
 protected:
  absl::StatusOr<v1::LiveState> GetLive(const std::string& since = "",
                                        const std::string& rig = "") {
    v1::GetLiveRequest request;
    request.set_rig(rig);
    request.set_since_revision(since);
    grpc::ClientContext context;
    v1::GetLiveResponse response;
    const grpc::Status status =
        v1::LiveService::NewStub(channel())->GetLive(&context, request, &response);
    if (!status.ok()) {
      return absl::Status(static_cast<absl::StatusCode>(status.error_code()),
                          status.error_message());
    }
    return response.live();
  }
  void Upload(const std::string& camera, uint32_t first_seq, uint32_t last_seq) {
    ASSERT_THAT(
        client().Upload(MakeBatch({.session_id = "wave", .camera = camera, .stream_epoch = 1},
                                  first_seq, last_seq)),
        IsOk());
    ingest_->WaitIdle();
    live_->Update();
  }
};

TEST_F(LiveService, AnswersWhatHasChanged) {
  StartWave({"left", "right"});
  live_->Update();
  ASSERT_OK_AND_ASSIGN(const v1::LiveState first, GetLive());
  EXPECT_TRUE(first.full());
  EXPECT_EQ(first.rig(), "rig");
  EXPECT_EQ(first.session().id(), "wave");
  EXPECT_EQ(first.session().state(), v1::Session::STATE_CAPTURING);
  EXPECT_THAT(first.session().cameras(), IsEmpty());
  EXPECT_THAT(first.cameras(), SizeIs(2));

  Upload("left", 1, 20);
  ASSERT_OK_AND_ASSIGN(const v1::LiveState second, GetLive(first.revision()));
  EXPECT_FALSE(second.full());
  EXPECT_NE(second.revision(), first.revision());
  ASSERT_THAT(second.cameras(), SizeIs(1));
  EXPECT_EQ(second.cameras(0).camera(), "left");
  EXPECT_EQ(second.cameras(0).observation_count(), 20u);
  EXPECT_EQ(second.cameras(0).wand_count(), 16u);
  EXPECT_FALSE(second.has_agents());
  // Who knows the newest is told nothing but that.
  ASSERT_OK_AND_ASSIGN(const v1::LiveState third, GetLive(second.revision()));
  v1::LiveState nothing;
  nothing.set_revision(second.revision());
  EXPECT_EQ(third.SerializeAsString(), nothing.SerializeAsString());
  // An older revision gets the sum of the changes.
  Upload("right", 1, 5);
  ASSERT_OK_AND_ASSIGN(const v1::LiveState sum, GetLive(first.revision()));
  EXPECT_FALSE(sum.full());
  EXPECT_THAT(sum.cameras(), SizeIs(2));
}

TEST_F(LiveService, AnswersEverythingToWhomItDoesNotKnow) {
  StartWave({"left"});
  live_->Update();
  ASSERT_OK_AND_ASSIGN(const v1::LiveState first, GetLive());
  for (const std::string& since :
       {std::string("x"), std::string("-"), first.revision() + "0", first.revision() + "x",
        first.revision().substr(0, 17), "0000000000000000" + first.revision().substr(16)}) {
    ASSERT_OK_AND_ASSIGN(const v1::LiveState answer, GetLive(since));
    EXPECT_TRUE(answer.full()) << since;
  }
  ASSERT_OK_AND_ASSIGN(const v1::LiveState other, GetLive(first.revision(), "other"));
  EXPECT_TRUE(other.full());
  EXPECT_EQ(other.rig(), "other");
  EXPECT_THAT(other.cameras(), IsEmpty());
}

TEST_F(LiveService, AnswersEverythingAfterARestart) {
  StartWave({"left"});
  Upload("left", 1, 20);
  ASSERT_OK_AND_ASSIGN(const v1::LiveState before, GetLive());
  RestartServer();
  ASSERT_OK_AND_ASSIGN(const v1::LiveState after, GetLive(before.revision()));
  EXPECT_TRUE(after.full());
  EXPECT_EQ(after.session().id(), "wave");
  ASSERT_THAT(after.cameras(), SizeIs(1));
  EXPECT_EQ(after.cameras(0).observation_count(), 20u);
}

TEST_F(LiveService, RefusesNamesAndBytesThatAreNone) {
  EXPECT_THAT(GetLive("", "no/rig"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("rig name")));
  EXPECT_THAT(GetLive(std::string(1000, '1')),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("since_revision")));
  EXPECT_THAT(GetLive("", std::string(1000, '1')),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("rig")));
}

TEST_F(LiveService, SerializesAnAnswerOnceForAll) {
  StartWave({"left"});
  live_->Update();
  server::LiveAnswers& answers = rpc_->live_answers();
  v1::GetLiveRequest request;
  ASSERT_OK_AND_ASSIGN(const auto first, answers.Get(request));
  ASSERT_OK_AND_ASSIGN(const auto second, answers.Get(request));
  EXPECT_EQ(first.bytes, second.bytes);
  EXPECT_FALSE(first.unchanged);
  request.set_since_revision(first.revision);
  ASSERT_OK_AND_ASSIGN(const auto third, answers.Get(request));
  EXPECT_TRUE(third.unchanged);
}

TEST_F(LiveService, KeepsGoalAndPredecessorOfASession) {
  v1::CreateSessionRequest request = WaveRequest("goal");
  request.mutable_goal()->set_until_mm(0.5);
  ASSERT_OK_AND_ASSIGN(const v1::Session created, client().CreateSession(request));
  EXPECT_EQ(created.goal().until_mm(), 0.5);
  EXPECT_EQ(created.goal().min_duration().seconds(), 20);
  ASSERT_OK_AND_ASSIGN(const v1::Session read, client().GetSession("goal"));
  EXPECT_EQ(read.goal().until_mm(), 0.5);
  live_->Update();
  ASSERT_OK_AND_ASSIGN(const v1::LiveState live, GetLive());
  EXPECT_EQ(live.goal().until_mm(), 0.5);
  EXPECT_FALSE(live.goal().reached());
  request = WaveRequest("next");
  request.set_continues("goal");
  EXPECT_THAT(client().CreateSession(request),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("not started")));
}

// The largest state that there can be: names of full length, every list at its limit.
TEST(LiveAnswerSize, IsBelowOneMebibyte) {
  constexpr size_t kCameras = 256;
  server::LiveSnapshot state;
  state.incarnation = std::string(16, 'f');
  state.revision = ~uint64_t{0};
  server::LiveOverlap overlap;
  server::LiveEstimate estimate;
  std::vector<server::LiveAlert> alerts;
  for (size_t i = 0; i < kCameras; ++i) {
    const std::string name = std::string(60, 'c') + std::to_string(1000 + i);
    server::LiveCamera camera;
    camera.camera = name;
    camera.agent_id = std::string(64, 'a');
    camera.observation_count = camera.wand_count = camera.backlog_count = camera.dropped_count =
        ~uint64_t{0};
    camera.observation_rate_hz = camera.wand_rate_hz = camera.reprojection_rms_px = 0.1;
    camera.shared_instant_count = camera.shared_instant_goal = ~uint32_t{0};
    camera.clock = {.time_offset_s = 0.1,
                    .time_offset_sigma_s = 0.1,
                    .sample_spread_s = 0.1,
                    .clock_epoch_count = ~uint32_t{0}};
    camera.coverage = {
        .columns = 16, .rows = 12, .counts = std::string(192, 'x'), .covered_share = 0.1};
    camera.trail.resize(40, {.age_ms = 2000, .x0_px = 1, .y0_px = 1, .x1_px = 1, .y1_px = 1});
    state.cameras[name] = {std::make_shared<const server::LiveCamera>(camera), 1};
    overlap.cameras.push_back(name);
    server::LiveEstimatedCamera estimated;
    estimated.camera = name;
    estimated.cam_from_rig.translation_m = {0.1, 0.1, 0.1};
    estimated.time_offset_s = estimated.reprojection_rms_px = estimated.focal_length_px = 0.1;
    estimate.cameras.push_back(estimated);
  }
  overlap.counts.resize(kCameras * (kCameras - 1) / 2, 1u << 20);
  estimate.volume = server::LiveVolume{};
  estimate.volume->sigma_mm.resize(4096, 1);
  estimate.volume->wand_counts.resize(4096, ~uint32_t{0});
  estimate.history.resize(300, {.time_s = 0.1, .p95_mm = 0.1});
  estimate.advice.resize(3, {.text = std::string(1024, 'x'), .cameras = overlap.cameras});
  for (int i = 0; i < 64; ++i) {
    alerts.push_back({.kind = "implausible_labels",
                      .camera = std::string(64, 'c'),
                      .text = std::string(512, 'x')});
  }
  std::vector<server::LiveAgent> agents(512, {.agent_id = std::string(64, 'a'),
                                              .host = std::string(128, 'h'),
                                              .connected = true,
                                              .spool_rows = ~uint64_t{0},
                                              .spool_bytes = ~uint64_t{0},
                                              .spool_limit_bytes = ~uint64_t{0},
                                              .software_version = std::string(64, 'v')});
  SessionSummary session;
  session.session.title = std::string(200, 't');
  state.overlap = {std::make_shared<const server::LiveOverlap>(overlap), 1};
  state.estimate = {std::make_shared<const server::LiveEstimate>(estimate), 1};
  state.alerts = {std::make_shared<const std::vector<server::LiveAlert>>(alerts), 1};
  state.agents = {std::make_shared<const std::vector<server::LiveAgent>>(agents), 1};
  state.session = {std::make_shared<const SessionSummary>(session), 1};
  EXPECT_LE(server::ToProto(state, std::nullopt).ByteSizeLong(), (size_t{1} << 20) - 4096);
}

}  // namespace
}  // namespace rigcal::testing::live_service_test
