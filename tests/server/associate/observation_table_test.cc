// SPDX-License-Identifier: Apache-2.0
#include "server/associate/observation_table.h"

#include <gtest/gtest.h>

namespace rigcal::server::observation_table_test {
namespace {

Observation Row(int64_t time_ns, double x, int markers = 3) {
  Observation row;
  row.time_ns = time_ns;
  row.markers.resize(static_cast<size_t>(markers));
  for (size_t m = 0; m < row.markers.size(); ++m) {
    MarkerObservation& marker = row.markers[m];
    marker.visible = true;
    marker.centre_px = {x + static_cast<double>(m), 2 * x};
    marker.covariance_px2 << 0.5, 0.125, 0.125, 0.25;
  }
  return row;
}

void ExpectEqual(const Observation& a, const Observation& b) {
  EXPECT_EQ(a.time_ns, b.time_ns);
  EXPECT_EQ(a.clock_epoch, b.clock_epoch);
  ASSERT_EQ(a.markers.size(), b.markers.size());
  for (size_t m = 0; m < a.markers.size(); ++m) {
    ASSERT_EQ(a.markers[m].visible, b.markers[m].visible);
    if (!a.markers[m].visible) continue;
    EXPECT_EQ(a.markers[m].centre_px, b.markers[m].centre_px);
    EXPECT_EQ(a.markers[m].covariance_px2, b.markers[m].covariance_px2);
    EXPECT_EQ(a.markers[m].time_delta_ns, b.markers[m].time_delta_ns);
    EXPECT_EQ(a.markers[m].label_confidence, b.markers[m].label_confidence);
    EXPECT_EQ(a.markers[m].centre_kind, b.markers[m].centre_kind);
  }
}

TEST(ObservationTable, GivesEveryRowBack) {
  std::vector<Observation> rows;
  for (int i = 0; i < 20; ++i) {
    Observation row = Row(10 * i, i);
    row.markers[static_cast<size_t>(i % 3)].visible = i % 4 != 0;
    if (i == 7) row.markers.clear();
    if (i == 9) row.markers[1].time_delta_ns = -5;
    if (i == 11) row.markers[2].label_confidence = 0.25f;
    if (i == 13) row.markers[0].centre_kind = CentreKind::kSphereCentre;
    if (i >= 15) row.clock_epoch = 2;
    rows.push_back(row);
  }
  const ObservationTable table(rows);
  ASSERT_EQ(table.size(), rows.size());
  size_t i = 0;
  for (const Observation& row : table) ExpectEqual(row, rows[i++]);
  EXPECT_EQ(i, rows.size());
  EXPECT_EQ(table.MarkerCount(7), 0u);
  EXPECT_FALSE(table.IsVisible(7, 0));
  EXPECT_EQ(table.VisibleCount(1), 3);
}

// Doubles that are no floats are kept to the last bit, whenever the first of them comes.
TEST(ObservationTable, KeepsEveryBitOfDoubles) {
  for (const int first : {0, 5}) {
    ObservationTable table;
    std::vector<Observation> rows;
    for (int i = 0; i < 10; ++i) {
      rows.push_back(Row(i, i >= first ? i + 0.1 : i));
      table.push_back(rows.back());
    }
    for (size_t i = 0; i < rows.size(); ++i) ExpectEqual(table[i], rows[i]);
  }
}

TEST(ObservationTable, MakesRoomForRowsWithMarkersAfterEmptyOnes) {
  ObservationTable table;
  table.push_back(Row(1, 0, 0));
  table.push_back(Row(2, 7));
  ExpectEqual(table[0], Row(1, 0, 0));
  ExpectEqual(table[1], Row(2, 7));
}

TEST(ObservationTable, SelectsRowsInAnyOrder) {
  const ObservationTable table({Row(1, 1), Row(2, 2), Row(3, 3)});
  const ObservationTable selected = table.Select({2, 0});
  ASSERT_EQ(selected.size(), 2u);
  ExpectEqual(selected[0], Row(3, 3));
  ExpectEqual(selected[1], Row(1, 1));
}

TEST(ObservationTable, FloatsTakeAThirdOfTheMemory) {
  ObservationTable table;
  table.reserve(1000, 3);
  for (int i = 0; i < 1000; ++i) table.push_back(Row(i, i));
  EXPECT_LT(table.Bytes(), 80'000u);
  EXPECT_GT(sizeof(Observation), 240u);
}

}  // namespace
}  // namespace rigcal::server::observation_table_test
