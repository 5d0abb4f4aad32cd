// SPDX-License-Identifier: Apache-2.0
#include "client/tables/session_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rigcal/v1/session_service.pb.h"
#include "tests/client/sample_messages.h"

namespace rigcal::client::session_table_test {
namespace {

using ::rigcal::testing::FullSession;
using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(FormatSession, ShowsCamerasAndRefusals) {
  const std::string text = FormatSession(FullSession());
  EXPECT_THAT(text, AllOf(HasSubstr("wave (rig rig): capturing"), HasSubstr("first try"),
                          HasSubstr("wand:0,0.13,0.39"), HasSubstr("1238 observations")));
  EXPECT_THAT(text, ContainsRegex("left +619 +610 +0 +0 +1 +yes +pc-left +yes\n"));
  EXPECT_THAT(text, ContainsRegex("right +619 +610 +0 +2 +1 +no +pc-right +yes\n"));
  // A refusal without a camera of its own belongs to the camera that lists it.
  EXPECT_THAT(text, ContainsRegex("right +csv_field_count +2 +right.csv:17: 6 fields"));
}

TEST(FormatSession, ShowsWhatBecameOfPicturesWhereThereAreAny) {
  v1::Session session = FullSession();
  EXPECT_THAT(FormatSession(session), Not(HasSubstr("pictures")));
  v1::FrameCounts* frames = session.mutable_cameras(1)->mutable_frames();
  frames->set_received(610);
  frames->set_damaged(2);
  frames->set_lost(7);
  frames->set_reconnects(1);
  v1::DetectionCounts* seen = session.mutable_cameras(1)->mutable_detections();
  seen->set_wand(600);
  seen->set_no_wand(5);
  seen->set_no_blob(4);
  seen->set_ambiguous(3);
  seen->set_too_many_blobs(8);
  seen->set_black(9);
  seen->set_saturated(11);
  EXPECT_THAT(FormatSession(session),
              ContainsRegex("right +610 +2 +7 +1 +600 +5 +4 +3 +8 +9 +11\n"));
  EXPECT_THAT(FormatSessionLine(session), HasSubstr("right 619 (9 of 619 pictures lost)"));
}

TEST(FormatSession, NamesMissingCameras) {
  v1::Session session = FullSession();
  EXPECT_THAT(FormatSession(session), Not(HasSubstr("missing")));
  session.set_state(v1::Session::STATE_FINISHED);
  session.add_missing_cameras("right");
  EXPECT_THAT(FormatSession(session), ContainsRegex("missing +right "));
}

TEST(FormatSession, SaysThatCamerasComeWithTheStart) {
  v1::Session session = FullSession();
  session.clear_cameras();
  EXPECT_THAT(FormatSession(session), HasSubstr("no cameras yet"));
}

TEST(FormatSession, CannotSteerTheTerminal) {
  v1::Session session = FullSession("\x1b[2J");
  session.set_title("\x1b[2J");
  session.mutable_cameras(0)->set_agent_id("\x1b[2J");
  EXPECT_THAT(FormatSession(session), Not(HasSubstr("\x1b")));
  EXPECT_THAT(FormatSessionLine(session), Not(HasSubstr("\x1b")));
}

TEST(FormatSessionLine, SaysHowFarEachCameraIs) {
  v1::Session session = FullSession();
  EXPECT_EQ(FormatSessionLine(session), "capturing: left 619 complete, right 619");
  session.mutable_cameras(1)->set_connected(false);
  EXPECT_EQ(FormatSessionLine(session), "capturing: left 619 complete, right 619 away");
  session.set_state(v1::Session::STATE_FINISHED);
  EXPECT_EQ(FormatSessionLine(session), "finished: left 619 complete, right 619");
  EXPECT_EQ(FormatSessionLine(v1::Session()), "state 0");
}

TEST(FormatSessionList, HasARowForEach) {
  v1::ListSessionsResponse response;
  EXPECT_EQ(FormatSessionList(response), "no sessions\n");
  *response.add_sessions() = FullSession("b");
  *response.add_sessions() = FullSession("a");
  EXPECT_THAT(FormatSessionList(response),
              ContainsRegex("\nb +rig +capturing +2 +1238 +1220 .*first try\na "));
}

}  // namespace
}  // namespace rigcal::client::session_table_test
