// SPDX-License-Identifier: Apache-2.0
#include "server/estimate/row_collection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace rigcal::server::row_collection_test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr int64_t kSecondNs = 1'000'000'000;

ObservationBatch Rows(const StreamKey& stream, double first_s, double rate_hz, int count) {
  ObservationBatch batch;
  batch.stream = stream;
  batch.marker_count = 1;
  for (int i = 0; i < count; ++i) {
    Observation row;
    row.time_ns = std::llround((first_s + i / rate_hz) * 1e9);
    row.markers.resize(1);
    row.markers[0].visible = true;
    row.markers[0].centre_px = {1.0 * i, 2};
    batch.Append(row);
  }
  return batch;
}

std::multiset<int64_t> Times(const RowCollection::Snapshot& snapshot, const std::string& camera) {
  std::multiset<int64_t> times;
  for (const ObservationBatch& batch : snapshot.rows.at(camera)) {
    times.insert(batch.time_ns.begin(), batch.time_ns.end());
  }
  return times;
}

TEST(RowCollection, KeepsEverythingOfASlowCamera) {
  RowCollection rows;
  const StreamKey left{"s", "left", 1};
  for (int i = 0; i < 10; ++i) rows.Add(left, Rows(left, i, 50, 50));
  const auto snapshot = rows.Take("s");
  ASSERT_TRUE(snapshot);
  EXPECT_EQ(Times(*snapshot, "left").size(), 500u);
  EXPECT_EQ(snapshot->seen_count, 500u);
  EXPECT_DOUBLE_EQ(snapshot->data_share, 1);
  for (const ObservationBatch& batch : snapshot->rows.at("left")) {
    EXPECT_TRUE(CheckShape(batch).ok());
  }
}

TEST(RowCollection, ThinsAFastCamera) {
  RowCollection rows({.max_rate_hz = 100});
  const StreamKey event{"s", "event", 1};
  rows.Add(event, Rows(event, 0, 1000, 2000));
  const auto snapshot = rows.Take("s");
  EXPECT_EQ(Times(*snapshot, "event").size(), 200u);
  EXPECT_NEAR(snapshot->data_share, 0.1, 0.01);
}

TEST(RowCollection, MemoryIsBoundedAndCamerasKeepTheSameTimes) {
  RowCollection rows({.max_rows_per_camera = 500});
  const StreamKey left{"s", "left", 1}, right{"s", "right", 1};
  for (int i = 0; i < 200; ++i) {
    rows.Add(left, Rows(left, i, 50, 50));
    rows.Add(right, Rows(right, i, 50, 50));
  }
  const auto snapshot = rows.Take("s");
  const auto left_times = Times(*snapshot, "left");
  EXPECT_LE(left_times.size(), 550u);
  EXPECT_GT(left_times.size(), 200u);
  EXPECT_EQ(left_times, Times(*snapshot, "right"));
  // From the beginning to the end, and in runs of neighbours.
  EXPECT_LT(*left_times.begin(), 20 * kSecondNs);
  EXPECT_GT(*left_times.rbegin(), 180 * kSecondNs);
  EXPECT_EQ(*std::next(left_times.begin()) - *left_times.begin(), kSecondNs / 50);
  EXPECT_NEAR(snapshot->data_share, static_cast<double>(left_times.size()) / 10'000, 1e-3);
}

TEST(RowCollection, ClocksOfTheirOwnOriginAreComparedBySamples) {
  RowCollection rows({.max_rows_per_camera = 200});
  const StreamKey left{"s", "left", 1}, right{"s", "right", 1};
  constexpr double kLaterS = 1234.25;
  for (int i = 0; i < 100; ++i) {
    ObservationBatch a = Rows(left, i, 20, 20), b = Rows(right, i + kLaterS, 20, 20);
    a.clock_samples.push_back({.device_ns = a.time_ns[0], .host_utc_ns = i * kSecondNs});
    b.clock_samples.push_back({.device_ns = b.time_ns[0], .host_utc_ns = i * kSecondNs});
    rows.Add(left, a);
    rows.Add(right, b);
  }
  const auto snapshot = rows.Take("s");
  std::multiset<int64_t> moved;
  for (const int64_t time : Times(*snapshot, "right")) {
    moved.insert(time - static_cast<int64_t>(kLaterS * 1e9));
  }
  EXPECT_EQ(moved, Times(*snapshot, "left"));
  size_t samples = 0;
  for (const ObservationBatch& batch : snapshot->rows.at("right")) {
    samples += batch.clock_samples.size();
  }
  EXPECT_EQ(samples, 100u);
}

TEST(RowCollection, SessionsAreApartAndForgotten) {
  RowCollection rows;
  const StreamKey a{"a", "left", 1}, b{"b", "left", 1};
  rows.Add(a, Rows(a, 0, 50, 10));
  rows.Add(b, Rows(b, 0, 50, 20));
  EXPECT_THAT(rows.Sessions(), ElementsAre("a", "b"));
  EXPECT_EQ(Times(*rows.Take("b"), "left").size(), 20u);
  rows.Forget("a");
  EXPECT_FALSE(rows.Take("a"));
  EXPECT_THAT(rows.Sessions(), ElementsAre("b"));
}

}  // namespace
}  // namespace rigcal::server::row_collection_test
