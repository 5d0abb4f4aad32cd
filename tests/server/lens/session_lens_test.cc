// SPDX-License-Identifier: Apache-2.0
#include "server/lens/session_lens.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "tests/common/lens/known_lens.h"
#include "tests/server/lens/board_session.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::session_lens_test {
namespace {

using server::FindLensCamera;
using server::ReadSessionViews;
using server::SessionViews;
using ::testing::AllOf;
using ::testing::HasSubstr;

class SessionLens : public StoreFixture {
 protected:
  Session Create(const Session& session) { return *store().CreateSession(session); }
};

TEST_F(SessionLens, ViewsAreChosenFromWhatIsStored) {
  const Session session = Create(OfBoard(CapturingSession({"left", "right"})));
  const std::vector<BoardView> waved = WavedViews(10);
  Append(RowsOfViews(KeyOf("left"), 1, waved));
  // The same again, one that is blurred, and two rows without the board.
  Append(RowsOfViews(KeyOf("left"), 11, {waved[3]}));
  Append(RowsOfViews(KeyOf("left"), 12, WavedViews(1, 9), 0.3));
  Append(RowsOfViews(KeyOf("left"), 13, {BoardView{}, BoardView{}}));
  Append(RowsOfViews(KeyOf("right"), 1, WavedViews(3)));
  ASSERT_OK_AND_ASSIGN(const SessionViews seen,
                       ReadSessionViews(store(), session, *session.FindCamera("left")));
  EXPECT_EQ(seen.observation_count, 14u);
  EXPECT_EQ(seen.board_count, 12u);
  EXPECT_EQ(seen.alike, 1);
  EXPECT_EQ(seen.blurred, 1);
  ASSERT_EQ(seen.views.size(), 10u);
  EXPECT_EQ(seen.views[2].name, "view at 0.2 s");
  EXPECT_EQ(seen.views[2].time_ns, 300'000'000);
  ASSERT_EQ(seen.views[2].corners.size(), waved[2].corners.size());
  EXPECT_EQ(seen.views[2].corners[5].x_in_board_m, waved[2].corners[5].x_in_board_m);
  EXPECT_LT((seen.views[2].corners[5].pixel - waved[2].corners[5].pixel).norm(), 1e-3);
}

TEST_F(SessionLens, ViewsAreInTheOrderOfTime) {
  const Session session = Create(OfBoard(CapturingSession({"left"})));
  const std::vector<BoardView> waved = WavedViews(6);
  // The agent was started again, and its second stream has the lower number.
  Append(RowsOfViews(KeyOf("left", 7), 1, {waved.begin(), waved.begin() + 3}));
  ObservationBatch later = RowsOfViews(KeyOf("left", 2), 1, {waved.begin() + 3, waved.end()});
  for (int64_t& time_ns : later.time_ns) time_ns += 1'000'000'000;
  Append(later);
  ASSERT_OK_AND_ASSIGN(const SessionViews seen,
                       ReadSessionViews(store(), session, session.cameras[0]));
  ASSERT_EQ(seen.views.size(), 6u);
  EXPECT_TRUE(std::ranges::is_sorted(seen.views, {}, &BoardView::time_ns));
}

TEST_F(SessionLens, CirclesOfACameraWithALensAreCorrectedAlready) {
  Session session = OfBoard(CapturingSession({"left", "right"}), "board:circles,4x11,0.02,0.012");
  session.cameras[1].description.intrinsics = KnownPinhole();
  session = Create(session);
  ObservationBatch rows = RowsOfViews(KeyOf("left"), 1, WavedViews(1));
  const uint32_t circles = 44;  // of the 54 columns
  rows.marker_count = circles;
  for (auto* column : {&rows.x_px, &rows.y_px, &rows.cov_xx_px2, &rows.cov_xy_px2, &rows.cov_yy_px2,
                       &rows.label_confidence}) {
    column->resize(circles);
  }
  rows.time_delta_ns.resize(circles);
  rows.centre_kind.resize(circles);
  rows.visible_mask = {static_cast<uint32_t>(
      circles - std::count(rows.centre_kind.begin(), rows.centre_kind.end(), 0))};
  for (const char* camera : {"left", "right"}) {
    rows.stream = KeyOf(camera);
    Append(rows);
    ASSERT_OK_AND_ASSIGN(const SessionViews seen,
                         ReadSessionViews(store(), session, *session.FindCamera(camera)));
    ASSERT_EQ(seen.views.size(), 1u);
    EXPECT_EQ(seen.views[0].corners[0].radius_m, camera == std::string("left") ? 0.006 : 0.0);
  }
}

TEST_F(SessionLens, SaysWhatALensIsMadeFrom) {
  const Session board = OfBoard(CapturingSession({"left", "right"}));
  EXPECT_THAT(FindLensCamera(board, "left"), IsOk());
  EXPECT_THAT(FindLensCamera(board, "top"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("it has left, right")));
  EXPECT_THAT(FindLensCamera(CapturingSession({"left"}), "left"),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("is no board"), HasSubstr("--target board:checker"))));
  Session pruned = board;
  pruned.observations_delete_utc_ns = 1;
  EXPECT_THAT(FindLensCamera(pruned, "left"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("were deleted")));
}

}  // namespace
}  // namespace rigcal::testing::session_lens_test
