// SPDX-License-Identifier: Apache-2.0
#include "server/standby/divergence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/status_matchers.h"

namespace rigcal::server::divergence_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

ReplicaRecord Wave(uint32_t left, uint32_t right) {
  return {.id = "wave",
          .streams = {{.stream = {"wave", "left", 1}, .durable_seq = left},
                      {.stream = {"wave", "right", 1}, .durable_seq = right}}};
}

ReplicaListing With(const ReplicaRecord& session) {
  ReplicaListing listing;
  listing.sessions = {session};
  return listing;
}

TEST(OwnExtras, RowsThatThePrimaryDoesNotHave) {
  EXPECT_THAT(OwnExtras(With(Wave(100, 100)), With(Wave(100, 120))), IsEmpty());
  EXPECT_THAT(OwnExtras(With(Wave(100, 150)), With(Wave(100, 120))),
              ElementsAre("session wave, camera right: observations 121 to 150 (30)"));
  // Of an agent that the primary has never heard of.
  EXPECT_THAT(OwnExtras(With(Wave(0, 5)), With({.id = "wave"})),
              ElementsAre("session wave, camera right: observations 1 to 5 (5)"));
}

TEST(OwnExtras, RecordsThatThePrimaryDoesNotHave) {
  ReplicaListing own = With(Wave(3, 4));
  own.calibrations = {{.id = "c-000002"}};
  EXPECT_THAT(OwnExtras(own, {}),
              ElementsAre("session wave with 7 observations", "calibration c-000002"));
  // What was deleted there is no loss.
  ReplicaListing primary;
  primary.deleted_sessions = {"wave"};
  EXPECT_THAT(OwnExtras(With(Wave(3, 4)), primary), IsEmpty());
}

TEST(RefuseExtras, NamesThemAndSaysWhatToDo) {
  EXPECT_THAT(RefuseExtras({}, "pc-1:7420", "/data"), IsOk());
  EXPECT_THAT(
      RefuseExtras(std::vector<std::string>(10, "session wave"), "pc-1:7420", "/data"),
      StatusIs(absl::StatusCode::kFailedPrecondition,
               AllOf(HasSubstr("/data has what pc-1:7420 does not have"), HasSubstr("session wave"),
                     HasSubstr("and 2 more"), HasSubstr("move the folder aside"))));
}

}  // namespace
}  // namespace rigcal::server::divergence_test
