// SPDX-License-Identifier: Apache-2.0
// `rigcal session` and `rigcal agent` against a server in this process.
#include "client/commands/session_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "common/wire/time_wire.h"
#include "tests/client/command_runner.h"
#include "tests/client/fake_server.h"
#include "tests/client/sample_messages.h"

namespace rigcal::client::session_command_test {
namespace {

using nlohmann::json;
using ::rigcal::testing::CommandOutcome;
using ::rigcal::testing::FakeServer;
using ::rigcal::testing::FullSession;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class SessionCommand : public ::testing::Test {
 protected:
  CommandOutcome Rigcal(std::vector<std::string> arguments, std::istream* in = nullptr) const {
    arguments.insert(arguments.end(), {"--server", fake_.address()});
    return rigcal::testing::Rigcal(arguments, in);
  }

  FakeServer fake_;
};

TEST_F(SessionCommand, CreateSendsEverything) {
  const CommandOutcome outcome = Rigcal(
      {"session", "create", "--target", "wand:0,0.13,0.39;diameter=0.04;hz=500", "--id", "wave",
       "--rig", "lab", "--title", "a title", "--camera", "left", "right", "--camera", "top,side"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const v1::CreateSessionRequest& request = fake_.created_session;
  EXPECT_EQ(request.id(), "wave");
  EXPECT_EQ(request.rig(), "lab");
  EXPECT_EQ(request.title(), "a title");
  EXPECT_THAT(request.camera_names(), ElementsAre("left", "right", "top", "side"));
  EXPECT_EQ(request.target().kind(), v1::Target::KIND_WAND);
  EXPECT_THAT(request.target().marker_positions_m(), ElementsAre(0, 0.13, 0.39));
  EXPECT_EQ(request.target().diameter_m(), 0.04);
  EXPECT_THAT(request.target().blink_hz(), ElementsAre(500));
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("wave"), HasSubstr("created")));
}

TEST_F(SessionCommand, CreateSendsTheGoal) {
  const auto create = [&](std::vector<std::string> more) {
    std::vector<std::string> arguments = {"session", "create", "--target", "wand:0,1"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Rigcal(arguments);
  };
  ASSERT_EQ(create({"--until-mm", "0.5", "--min-seconds", "30", "--continue", "before"}).exit_code,
            0);
  EXPECT_EQ(fake_.created_session.goal().until_mm(), 0.5);
  EXPECT_EQ(fake_.created_session.goal().min_duration().seconds(), 30);
  EXPECT_EQ(fake_.created_session.continues(), "before");
  ASSERT_EQ(create({"--until-mm", "2"}).exit_code, 0);
  EXPECT_FALSE(fake_.created_session.goal().has_min_duration());
  ASSERT_EQ(create({}).exit_code, 0);
  EXPECT_FALSE(fake_.created_session.has_goal());
  for (const char* bad : {"0", "-1", "nan", "1001", "x"}) {
    EXPECT_EQ(create({"--until-mm", bad}).exit_code, 2) << bad;
  }
  EXPECT_EQ(create({"--min-seconds", "3"}).exit_code, 2);
}

TEST_F(SessionCommand, DiscardMarksAndTakesBack) {
  fake_.sessions["wave"] = FullSession();
  const CommandOutcome discarded = Rigcal({"session", "discard", "wave"});
  ASSERT_EQ(discarded.exit_code, 0) << discarded.err;
  EXPECT_THAT(discarded.out, HasSubstr("thrown away"));
  EXPECT_THAT(Rigcal({"session", "list"}).out, HasSubstr("thrown away"));
  const CommandOutcome undone = Rigcal({"session", "discard", "wave", "--undo"});
  EXPECT_THAT(undone.out, ::testing::Not(HasSubstr("thrown away")));
  EXPECT_EQ(Rigcal({"session", "discard", "nobody"}).exit_code, 1);
}

TEST_F(SessionCommand, ResumeStartsOneThatGoesOn) {
  v1::Session before = FullSession();
  before.set_id("wave");
  before.set_state(v1::Session::STATE_FINISHED);
  before.clear_requested_cameras();
  before.add_requested_cameras("left");
  fake_.sessions["wave"] = before;
  const CommandOutcome outcome =
      Rigcal({"session", "resume", "wave", "--until-mm", "0.4", "-o", "json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(json::parse(outcome.out).at("state"), "STATE_CAPTURING");
  const v1::CreateSessionRequest& request = fake_.created_session;
  EXPECT_EQ(request.continues(), "wave");
  EXPECT_EQ(request.rig(), before.rig());
  EXPECT_EQ(request.target().SerializeAsString(), before.target().SerializeAsString());
  EXPECT_THAT(request.camera_names(), ElementsAre("left"));
  EXPECT_EQ(request.goal().until_mm(), 0.4);
  EXPECT_EQ(Rigcal({"session", "resume", "nobody"}).exit_code, 1);
}

TEST_F(SessionCommand, TellsWhoStopsSecond) {
  {
    const std::lock_guard lock(fake_.mutex);
    v1::Session session = FullSession();
    session.set_id("wave");
    session.set_state(v1::Session::STATE_DRAINING);
    session.set_stop_reason("the expected error is 0.46 mm");
    fake_.sessions["wave"] = session;
  }
  EXPECT_THAT(Rigcal({"session", "stop", "wave"}).err,
              HasSubstr("session wave had been stopped already: the expected error is 0.46 mm"));
  {
    const std::lock_guard lock(fake_.mutex);
    fake_.sessions["wave"].mutable_stop_time()->set_seconds(1'700'000'000);
  }
  EXPECT_THAT(Rigcal({"session", "stop", "wave"}).err,
              AllOf(HasSubstr("session wave had been stopped already, at 2023-11-1"),
                    HasSubstr(": the expected error is 0.46 mm")));
}

TEST_F(SessionCommand, CreateWithStartStarts) {
  const CommandOutcome outcome =
      Rigcal({"session", "create", "--target", "wand:0,1", "--start", "-o", "json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(json::parse(outcome.out).at("state"), "STATE_CAPTURING");
}

TEST_F(SessionCommand, CreateThatCannotStartNamesTheSessionThatStays) {
  fake_.failures["StartSession"] =
      grpc::Status(grpc::StatusCode::FAILED_PRECONDITION, "no camera is connected");
  const CommandOutcome outcome =
      Rigcal({"session", "create", "--target", "wand:0,1", "--start", "--id", "wave"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("wave"), HasSubstr("no camera is connected")));
  EXPECT_THAT(outcome.out, IsEmpty());
}

TEST_F(SessionCommand, GetPrintsTheSession) {
  fake_.sessions["wave"] = FullSession("wave");
  EXPECT_THAT(Rigcal({"session", "get", "wave"}).out, HasSubstr("csv_field_count"));
  const json session = json::parse(Rigcal({"session", "get", "wave", "-o", "json"}).out);
  EXPECT_EQ(session.at("observation_count"), "1238") << "64 bits are a string";
  EXPECT_EQ(session.at("late_count"), "0");
  EXPECT_EQ(session.at("cameras").at(0).at("description").at("camera"), "left");
}

TEST_F(SessionCommand, ListReadsEveryPage) {
  for (const char* id : {"a", "b", "c", "d", "e"}) fake_.sessions[id] = FullSession(id);
  fake_.page_size = 2;
  const json list = json::parse(Rigcal({"session", "list", "-o", "json"}).out);
  EXPECT_EQ(list.at("sessions").size(), 5u);
  EXPECT_EQ(list.at("next_page_token"), "");
  fake_.sessions["b"].set_rig("other");
  EXPECT_THAT(Rigcal({"session", "list", "--rig", "other"}).out, HasSubstr("\nb "));
}

TEST_F(SessionCommand, ListThatFailsOnALaterPageFails) {
  fake_.failures["ListSessions"] = grpc::Status(grpc::StatusCode::INTERNAL, "page lost");
  const CommandOutcome outcome = Rigcal({"session", "list"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("page lost"));
}

TEST_F(SessionCommand, StopWaitsUntilItIsFinishedAndNamesTheMissing) {
  fake_.sessions["wave"] = FullSession("wave");
  int asked = 0;
  fake_.on_get_session = [&](v1::Session& session) {
    if (++asked < 3) return;
    session.set_state(v1::Session::STATE_FINISHED);
    session.clear_missing_cameras();
    session.add_missing_cameras("right");
  };
  const CommandOutcome outcome =
      Rigcal({"session", "stop", "wave", "--drain-timeout", "2.5", "--wait", "-o", "json"});
  // Nothing proves that the rest is there.
  EXPECT_EQ(outcome.exit_code, 5) << outcome.err;
  EXPECT_EQ(wire::SecondsOf(fake_.stopped_session.drain_timeout()), 2.5);
  EXPECT_EQ(json::parse(outcome.out).at("state"), "STATE_FINISHED");
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("right"), HasSubstr("next: rigcal session verify wave")));
}

TEST_F(SessionCommand, StopWithoutWaitReturnsAtOnce) {
  fake_.sessions["wave"] = FullSession("wave");
  const CommandOutcome outcome = Rigcal({"session", "stop", "wave", "-o", "json"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(json::parse(outcome.out).at("state"), "STATE_DRAINING");
  EXPECT_EQ(wire::SecondsOf(fake_.stopped_session.drain_timeout()), 0);
}

TEST_F(SessionCommand, DeleteSaysWhatItDid) {
  fake_.sessions["wave"] = FullSession("wave");
  EXPECT_THAT(Rigcal({"session", "delete", "wave", "--yes"}).out, HasSubstr("wave"));
  EXPECT_TRUE(fake_.sessions.empty());
  EXPECT_EQ(Rigcal({"session", "delete", "wave", "--yes"}).exit_code, 1);
  fake_.sessions["wave"] = FullSession("wave");
  EXPECT_EQ(json::parse(Rigcal({"session", "delete", "wave", "--yes", "-o", "json"}).out),
            json::object());
}

TEST_F(SessionCommand, DeleteAsksOrNeedsYes) {
  fake_.sessions["wave"] = FullSession("wave");
  const CommandOutcome unasked = Rigcal({"session", "delete", "wave"});
  EXPECT_EQ(unasked.exit_code, 2);
  EXPECT_THAT(unasked.err, HasSubstr("--yes"));
  for (const char* answer : {"n\n", "\n", "", "yep\n"}) {
    std::istringstream in(answer);
    const CommandOutcome refused = Rigcal({"session", "delete", "wave"}, &in);
    EXPECT_EQ(refused.exit_code, 1) << answer;
    EXPECT_THAT(refused.err, AllOf(HasSubstr("delete session wave with"), HasSubstr("nothing")));
  }
  EXPECT_EQ(fake_.sessions.size(), 1u);
  std::istringstream in("y\n");
  EXPECT_EQ(Rigcal({"session", "delete", "wave"}, &in).exit_code, 0);
  EXPECT_TRUE(fake_.sessions.empty());
}

v1::Session At(v1::Session::State state, uint32_t observation_count) {
  v1::Session session = FullSession("wave");
  session.set_state(state);
  session.mutable_cameras(0)->set_observation_count(observation_count);
  return session;
}

TEST_F(SessionCommand, WatchPrintsALinePerChangeUntilFinished) {
  fake_.watches.push_back(
      {{At(v1::Session::STATE_CAPTURING, 1), At(v1::Session::STATE_CAPTURING, 1),
        At(v1::Session::STATE_DRAINING, 2), At(v1::Session::STATE_FINISHED, 3)},
       grpc::Status::OK});
  const CommandOutcome outcome = Rigcal({"session", "watch", "wave"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.out,
            "capturing: left 1 complete, right 619\n"
            "draining: left 2 complete, right 619\n"
            "finished: left 3 complete, right 619\n");
}

TEST_F(SessionCommand, WatchInJsonIsOneObjectPerLine) {
  fake_.watches.push_back(
      {{At(v1::Session::STATE_CAPTURING, 1), At(v1::Session::STATE_FINISHED, 3)},
       grpc::Status::OK});
  std::istringstream lines(Rigcal({"session", "watch", "wave", "-o", "json"}).out);
  std::vector<std::string> states;
  for (std::string line; std::getline(lines, line);) {
    states.push_back(json::parse(line).at("state"));
  }
  EXPECT_THAT(states, ElementsAre("STATE_CAPTURING", "STATE_FINISHED"));
}

TEST_F(SessionCommand, WatchGoesOnAfterTheServerWasAway) {
  fake_.watches.push_back({{At(v1::Session::STATE_CAPTURING, 1)},
                           grpc::Status(grpc::StatusCode::UNAVAILABLE, "shutting down")});
  fake_.watches.push_back(
      {{At(v1::Session::STATE_CAPTURING, 1), At(v1::Session::STATE_CAPTURING, 2)},
       grpc::Status::OK});
  fake_.watches.push_back({{At(v1::Session::STATE_FINISHED, 3)}, grpc::Status::OK});
  const CommandOutcome outcome = Rigcal({"session", "watch", "wave"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.out,
            "capturing: left 1 complete, right 619\n"
            "capturing: left 2 complete, right 619\n"
            "finished: left 3 complete, right 619\n");
}

TEST_F(SessionCommand, WatchOfNothingFails) {
  const CommandOutcome outcome = Rigcal({"session", "watch", "nobody"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("nobody"));
}

TEST_F(SessionCommand, WatchOfADeletedSessionFails) {
  fake_.watches.push_back({{At(v1::Session::STATE_CAPTURING, 1)},
                           grpc::Status(grpc::StatusCode::NOT_FOUND, "session wave was deleted")});
  const CommandOutcome outcome = Rigcal({"session", "watch", "wave"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("deleted"));
}

v1::ObservationBatch TwoRows() {
  v1::ObservationBatch batch;
  batch.set_session_id("wave");
  batch.set_camera("left");
  batch.set_stream_epoch(2);
  batch.set_first_seq(7);
  batch.set_clock_epoch(1);
  batch.set_marker_count(2);
  for (const int64_t time_ns : {598370000LL, 698298000LL}) batch.add_time_ns(time_ns);
  batch.add_visible_mask(0b11);
  batch.add_visible_mask(0b10);
  for (const float x_px : {570.5163f, 542.67391f, 0.0f, 0.1f}) batch.add_x_px(x_px);
  for (const float y_px : {386.5f, 389.25f, 0.0f, 1023.0f}) batch.add_y_px(y_px);
  for (int i = 0; i < 4; ++i) {
    batch.add_cov_xx_px2(0.25f);
    batch.add_cov_xy_px2(0);
    batch.add_cov_yy_px2(0.25f);
  }
  batch.add_centre_kind(v1::CENTRE_KIND_IMAGE_BLOB);
  return batch;
}

TEST_F(SessionCommand, ObservationsAreCsvWithEmptyFieldsForWhatWasNotSeen) {
  fake_.sessions["wave"] = FullSession("wave");
  fake_.sessions["wave"].mutable_target()->mutable_marker_positions_m()->RemoveLast();
  fake_.observations.push_back(TwoRows());
  const CommandOutcome outcome =
      Rigcal({"session", "observations", "wave", "--camera", "left", "--include-late"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.out,
            "camera,stream_epoch,seq,clock_epoch,time_ns,x0_px,y0_px,x1_px,y1_px\n"
            "left,2,7,1,598370000,570.516296,386.5,542.673889,389.25\n"
            "left,2,8,1,698298000,,,0.100000001,1023\n");
  EXPECT_EQ(fake_.read_observations.session_id(), "wave");
  EXPECT_EQ(fake_.read_observations.camera(), "left");
  EXPECT_TRUE(fake_.read_observations.include_late());
}

TEST_F(SessionCommand, ObservationsAsJsonAreOneBatchPerLine) {
  fake_.sessions["wave"] = FullSession("wave");
  fake_.observations = {TwoRows(), TwoRows()};
  const CommandOutcome outcome = Rigcal({"session", "observations", "wave", "-o", "json"});
  std::istringstream lines(outcome.out);
  int count = 0;
  for (std::string line; std::getline(lines, line); ++count) {
    EXPECT_EQ(json::parse(line).at("first_seq"), 7);
  }
  EXPECT_EQ(count, 2);
}

TEST_F(SessionCommand, ObservationsThatCannotBeReadAreNotHalfPrintedAsGood) {
  fake_.sessions["wave"] = FullSession("wave");
  fake_.observations = {TwoRows(), TwoRows()};
  fake_.observations[1].mutable_x_px()->RemoveLast();
  const CommandOutcome outcome = Rigcal({"session", "observations", "wave"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("x_px"));
}

TEST_F(SessionCommand, ObservationsOfNothingFail) {
  const CommandOutcome outcome = Rigcal({"session", "observations", "nobody"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.out, IsEmpty());
}

TEST_F(SessionCommand, VerifyProvesASessionOrNamesWhatIsMissing) {
  fake_.sessions["wave"].set_id("wave");
  fake_.sessions["wave"].set_state(v1::Session::STATE_FINISHED);
  v1::StreamAudit& audit = fake_.audit.emplace_back();
  audit.set_camera("left");
  audit.set_stream_epoch(1234);
  audit.set_durable_seq(50);
  audit.set_last_seq(50);
  audit.set_highest_seq(50);
  audit.set_ended(true);
  audit.set_stored_count(50);
  CommandOutcome outcome = Rigcal({"session", "verify", "wave"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("left"), HasSubstr("1234"),
                                 HasSubstr("\nverified: 50 detected = 50 durable")));
  fake_.audit[0].set_stored_count(48);
  outcome = Rigcal({"session", "verify", "wave"});
  EXPECT_EQ(outcome.exit_code, 5);
  EXPECT_THAT(outcome.out, HasSubstr("not verified: camera left, stream 1234: detected 50"));
  outcome = Rigcal({"session", "verify", "wave", "-o", "json"});
  EXPECT_EQ(outcome.exit_code, 5);
  EXPECT_EQ(json::parse(outcome.out).at("streams").at(0).at("missing"), 2);
  EXPECT_EQ(Rigcal({"session", "verify", "nobody"}).exit_code, 1);
}

TEST_F(SessionCommand, VerifyTellsWhereTheSpoolOfAnAgentIs) {
  fake_.sessions["wave"].set_id("wave");
  v1::StreamAudit& audit = fake_.audit.emplace_back();
  audit.set_camera("left");
  audit.set_stream_epoch(1234);
  audit.set_agent_id("pc-1");
  audit.set_holder(v1::StreamAudit::HOLDER_AWAY);
  audit.mutable_reported()->set_last_seq(50);
  audit.mutable_reported()->set_spooled_count(50);
  v1::Agent* agent = fake_.agents.add_agents();
  agent->set_agent_id("pc-1");
  agent->set_host("lab-7");
  CommandOutcome outcome = Rigcal({"session", "verify", "wave"});
  EXPECT_EQ(outcome.exit_code, 5);
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("agent pc-1 on lab-7"), HasSubstr("rows 1 to 50 (50)")));
  // Who may not list them gets the rest.
  fake_.failures["ListAgents"] = grpc::Status(grpc::StatusCode::PERMISSION_DENIED, "no");
  outcome = Rigcal({"session", "verify", "wave"});
  EXPECT_EQ(outcome.exit_code, 5);
  EXPECT_THAT(outcome.out, HasSubstr("the spool of agent pc-1; start agent pc-1 again"));
}

TEST_F(SessionCommand, VerifyOfADamagedRecordIsNotVerified) {
  fake_.failures["GetSession"] =
      grpc::Status(grpc::StatusCode::DATA_LOSS, "session wave is damaged");
  EXPECT_EQ(Rigcal({"session", "verify", "wave"}).exit_code, 5);
  fake_.failures["GetSession"] = grpc::Status(grpc::StatusCode::UNAVAILABLE, "gone");
  EXPECT_EQ(Rigcal({"session", "verify", "wave"}).exit_code, 6);
}

TEST_F(SessionCommand, AgentListShowsTheSpool) {
  v1::Agent* agent = fake_.agents.add_agents();
  agent->set_agent_id("pc-1");
  EXPECT_THAT(Rigcal({"agent", "list"}).out, ::testing::ContainsRegex("pc-1 .* - *\n"));
  agent->mutable_spool()->set_row_count(1200);
  agent->mutable_spool()->set_bytes(150 * 1024);
  agent->mutable_spool()->set_problem("the spool is full");
  v1::RefusalCount* dropped = agent->mutable_spool()->add_dropped();
  dropped->set_reason(v1::REFUSAL_REASON_SPOOL_FULL);
  dropped->set_count(12);
  EXPECT_THAT(Rigcal({"agent", "list"}).out,
              AllOf(HasSubstr("1200 rows, 150 KiB, 12 dropped, has a problem"),
                    HasSubstr("\nagent pc-1: the spool is full\n"),
                    HasSubstr("agent pc-1: 12 observations dropped: spool_full\n")));
}

TEST_F(SessionCommand, AgentListShowsCameras) {
  EXPECT_THAT(Rigcal({"agent", "list"}).out, HasSubstr("no agents"));
  v1::Agent* agent = fake_.agents.add_agents();
  agent->set_agent_id("pc-1");
  agent->set_connected(true);
  for (const char* camera : {"left", "right"}) agent->add_cameras()->set_camera(camera);
  agent->mutable_cameras(0)->mutable_image_size_px()->set_width(1280);
  agent->mutable_cameras(0)->mutable_image_size_px()->set_height(1024);
  agent->mutable_cameras(0)->mutable_intrinsics();
  agent->mutable_cameras(0)->set_source("csv:left.csv");
  v1::CameraSettings* settings = agent->mutable_cameras(1)->mutable_settings();
  settings->set_model("Maker One 123");
  settings->set_pixel_format("BayerRG8");
  settings->set_exposure_s(0.005);
  settings->set_gain_db(6);
  settings->set_frame_rate_hz(50);
  settings->set_trigger("Line0");
  settings->set_ptp(true);
  const std::string text = Rigcal({"agent", "list"}).out;
  EXPECT_THAT(text,
              ::testing::ContainsRegex("pc-1 .*connected .*left +1280x1024 +yes +- +csv:left"));
  EXPECT_THAT(text, ::testing::ContainsRegex(
                        "\n +right +- +no +BayerRG8, 5 ms, 6 dB, 50 Hz, Line0, PTP\n"));
  const json list = json::parse(Rigcal({"agent", "list", "-o", "json"}).out);
  EXPECT_EQ(list.at("agents").at(0).at("agent_id"), "pc-1");
  EXPECT_EQ(list.at("agents").at(0).at("cameras").at(1).at("settings").at("model"),
            "Maker One 123");
}

}  // namespace
}  // namespace rigcal::client::session_command_test
