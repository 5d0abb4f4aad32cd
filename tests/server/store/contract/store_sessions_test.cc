// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <vector>

#include "tests/server/store/contract/store_contract.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::store_sessions_test {
namespace {

using ::rigcal::testing::CapturingSession;
using ::rigcal::testing::EndDelivery;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::StatusIs;
using ::testing::_;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class StoreSessions : public ::rigcal::testing::StoreContract {
 protected:
  std::string Create(const std::string& rig = "rig", const std::string& id = "") {
    Session session = CapturingSession({"a"});
    session.id = id;
    session.rig = rig;
    const auto created = store().CreateSession(session);
    EXPECT_THAT(created, IsOk());
    return created.ok() ? created->id : "";
  }
  std::vector<std::string> Ids(const SessionFilter& filter, const ListPage& page) {
    const auto sessions = store().ListSessions(filter, page);
    EXPECT_THAT(sessions, IsOk());
    std::vector<std::string> ids;
    for (const auto& [summary, position] : *sessions) {
      EXPECT_EQ(summary.damage, "");
      ids.push_back(summary.session.id);
      last_ = position;
    }
    return ids;
  }

  std::optional<RecordPosition> last_;  // of the last list
};

TEST_P(StoreSessions, GivesBackWhatWasStoredAlsoAfterReopening) {
  Session session = CapturingSession({"a", "b"});
  session.title = "first wave";
  session.create_utc_ns = 123;
  session.missing_cameras = {"b"};
  ASSERT_THAT(store().CreateSession(session), IsOk());
  session.state = SessionState::kDraining;
  session.stop_utc_ns = 456;
  ASSERT_THAT(store().UpdateSession(session), IsOk());
  Reopen();
  ASSERT_OK_AND_ASSIGN(const Session read, store().GetSession("s-test"));
  EXPECT_EQ(read.title, "first wave");
  EXPECT_EQ(read.state, SessionState::kDraining);
  EXPECT_EQ(read.target, session.target);
  EXPECT_EQ(read.create_utc_ns, 123);
  EXPECT_EQ(read.stop_utc_ns, 456);
  EXPECT_EQ(read.missing_cameras, session.missing_cameras);
  ASSERT_EQ(read.cameras.size(), 2u);
  EXPECT_EQ(read.cameras[1].description, session.cameras[1].description);
}

TEST_P(StoreSessions, NamesTheSessionThatIsNotThere) {
  EXPECT_THAT(store().GetSession("s-000009"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("s-000009")));
  EXPECT_THAT(store().UpdateSession(CapturingSession({})),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("s-test")));
  EXPECT_THAT(store().DeleteSession("s-000009"), StatusIs(absl::StatusCode::kNotFound, _));
  EXPECT_THAT(store().GetSessionCounts("s-000009"), StatusIs(absl::StatusCode::kNotFound, _));
}

TEST_P(StoreSessions, NeverGivesAnIdTwice) {
  EXPECT_EQ(Create(), "s-000001");
  EXPECT_EQ(Create(), "s-000002");
  ASSERT_THAT(store().DeleteSession("s-000002"), IsOk());
  Reopen();
  EXPECT_EQ(Create(), "s-000003");
  EXPECT_EQ(Create("rig", "s-000004"), "s-000004");
  EXPECT_EQ(Create("rig", "s-000005"), "s-000005");
  ASSERT_THAT(store().DeleteSession("s-000005"), IsOk());
  EXPECT_EQ(Create(), "s-000006");
}

TEST_P(StoreSessions, RefusesIdsThatAreOrWereInUse) {
  Create("rig", "wave");
  Session again = CapturingSession({"a"});
  again.id = "wave";
  EXPECT_THAT(store().CreateSession(again),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("wave")));
  ASSERT_THAT(store().DeleteSession("wave"), IsOk());
  EXPECT_THAT(store().CreateSession(again),
              StatusIs(absl::StatusCode::kAlreadyExists, HasSubstr("deleted")));
  again.id = "no/name";
  EXPECT_THAT(store().CreateSession(again), StatusIs(absl::StatusCode::kInvalidArgument, _));
}

TEST_P(StoreSessions, ListsNewestFirstByRigInPages) {
  for (const char* id : {"z", "y", "x"}) Create("left", id);
  Create("right", "w");
  EXPECT_THAT(Ids({}, {.limit = 10}), ElementsAre("w", "x", "y", "z"));
  EXPECT_THAT(Ids({.rig = "left"}, {.limit = 2}), ElementsAre("x", "y"));
  EXPECT_THAT(Ids({.rig = "left"}, {.limit = 2, .after = last_}), ElementsAre("z"));
  EXPECT_THAT(Ids({.rig = "none"}, {.limit = 2}), IsEmpty());
}

TEST_P(StoreSessions, ListsInEveryOrderAndByState) {
  for (const char* id : {"b", "c", "a"}) Create("rig", id);
  Session created = CapturingSession({});
  created.id = "d";
  created.state = SessionState::kCreated;
  ASSERT_THAT(store().CreateSession(created), IsOk());
  const auto page = [](RecordOrder order) { return ListPage{.order = order, .limit = 9}; };
  EXPECT_THAT(Ids({}, page(RecordOrder::kOldestFirst)), ElementsAre("b", "c", "a", "d"));
  EXPECT_THAT(Ids({}, page(RecordOrder::kIdAscending)), ElementsAre("a", "b", "c", "d"));
  EXPECT_THAT(Ids({}, page(RecordOrder::kIdDescending)), ElementsAre("d", "c", "b", "a"));
  EXPECT_THAT(Ids({.state = SessionState::kCapturing}, page(RecordOrder::kIdAscending)),
              ElementsAre("a", "b", "c"));
}

TEST_P(StoreSessions, ContinuesAPageAfterItsLastSessionWasDeleted) {
  for (const RecordOrder order : {RecordOrder::kNewestFirst, RecordOrder::kIdDescending}) {
    const std::string prefix = order == RecordOrder::kNewestFirst ? "m" : "n";
    for (const char* id : {"x", "y", "z"}) Create(prefix, prefix + id);
    Ids({.rig = prefix}, {.order = order, .limit = 2});
    ASSERT_THAT(store().DeleteSession(prefix + "y"), IsOk());
    EXPECT_THAT(Ids({.rig = prefix}, {.order = order, .limit = 9, .after = last_}),
                ElementsAre(prefix + "x"));
  }
}

TEST_P(StoreSessions, ListsSumsWithoutTheCameras) {
  Session session = CapturingSession({"a", "b"});
  session.title = "wave";
  session.finish_utc_ns = 7;
  session.missing_cameras = {"b"};
  session.requested_cameras = {"a", "b"};
  ASSERT_THAT(store().CreateSession(session), IsOk());
  Append(MakeBatch(KeyOf("a"), 1, 20));
  Append(MakeBatch(KeyOf("b"), 1, 10));
  ASSERT_OK_AND_ASSIGN(const auto listed, store().ListSessions({}, {.limit = 9}));
  ASSERT_EQ(listed.size(), 1u);
  const SessionSummary& summary = listed[0].record;
  EXPECT_EQ(summary.session.title, "wave");
  EXPECT_EQ(summary.session.state, SessionState::kCapturing);
  EXPECT_EQ(summary.session.finish_utc_ns, 7);
  EXPECT_EQ(summary.session.target, session.target);
  EXPECT_TRUE(summary.session.cameras.empty());
  EXPECT_TRUE(summary.session.missing_cameras.empty());
  EXPECT_TRUE(summary.session.requested_cameras.empty());
  EXPECT_EQ(summary.camera_count, 2u);
  EXPECT_EQ(summary.observation_count, 30u);
  EXPECT_EQ(summary.wand_count, 24u);
  EXPECT_EQ(summary.late_count, 0u);
  session.title = "another";
  ASSERT_THAT(store().UpdateSession(session), IsOk());
  EXPECT_EQ(store().ListSessions({}, {.limit = 9})->at(0).record.session.title, "another");
}

TEST_P(StoreSessions, DeletesObservationsAndKeepsTheCounts) {
  ASSERT_THAT(store().CreateSession(CapturingSession({"a"})), IsOk());
  Append(MakeBatch(KeyOf("a"), 1, 20));
  ASSERT_THAT(store().DeleteObservations("s-test", 123), IsOk());
  EXPECT_TRUE(::rigcal::testing::ReadRows(store()).empty());
  EXPECT_EQ(store().GetSession("s-test")->observations_delete_utc_ns, 123);
  EXPECT_EQ(store().GetSessionCounts("s-test")->at(0).observation_count, 20u);
  EXPECT_EQ(store().GetStream(KeyOf("a"))->durable_seq, 20u);
  EXPECT_EQ(store().ListSessions({}, {.limit = 9})->at(0).record.session.observations_delete_utc_ns,
            123);
  EXPECT_THAT(store().DeleteObservations("s-000009", 1), StatusIs(absl::StatusCode::kNotFound, _));
}

TEST_P(StoreSessions, TakesCamerasUntilTheyHaveObservations) {
  Session session = CapturingSession({});
  session.state = SessionState::kCreated;
  ASSERT_THAT(store().CreateSession(session), IsOk());
  EXPECT_TRUE(store().GetSessionCounts("s-test")->empty());
  ASSERT_THAT(store().UpdateSession(CapturingSession({"c", "a", "b"})), IsOk());
  ASSERT_THAT(store().UpdateSession(CapturingSession({"a", "b"})), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto counts, store().GetSessionCounts("s-test"));
  ASSERT_EQ(counts.size(), 2u);
  EXPECT_EQ(counts[0].camera, "a");
  EXPECT_EQ(counts[1].camera, "b");
  EXPECT_FALSE(counts[0].ended());

  Append(MakeBatch(KeyOf("b"), 1, 4));
  EXPECT_THAT(store().UpdateSession(CapturingSession({"a"})),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("camera b")));
  EXPECT_EQ(store().GetSession("s-test")->cameras.size(), 2u);
}

TEST_P(StoreSessions, DeletesObservationsOfThatSessionOnly) {
  ASSERT_THAT(store().CreateSession(CapturingSession({"a", "b"})), IsOk());
  Session other = CapturingSession({"a"});
  other.id = "other";
  ASSERT_THAT(store().CreateSession(other), IsOk());
  StreamKey other_stream = KeyOf("a");
  other_stream.session_id = "other";
  Append(MakeBatch(KeyOf("a"), 1, 20));
  Append(MakeBatch(KeyOf("b"), 1, 20));
  Append(MakeBatch(other_stream, 1, 20));

  ASSERT_THAT(store().DeleteSession("s-test"), IsOk());
  EXPECT_THAT(store().GetStream(KeyOf("a")), StatusIs(absl::StatusCode::kNotFound, _));
  EXPECT_THAT(store().ReadObservations("s-test", "", [](StoredBatch) { return absl::OkStatus(); }),
              StatusIs(absl::StatusCode::kNotFound, _));
  EXPECT_EQ(::rigcal::testing::ReadRows(store(), "other").size(), 20u);
  EXPECT_TRUE(Append(MakeBatch(KeyOf("a"), 21, 30)).unknown);
}

RIGCAL_FOR_EVERY_STORE(StoreSessions);

}  // namespace
}  // namespace rigcal::server::store_sessions_test
