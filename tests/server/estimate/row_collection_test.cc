// SPDX-License-Identifier: Apache-2.0
#include "server/estimate/row_collection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
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

const RowCollection::Track& TrackOf(const RowCollection::Snapshot& snapshot,
                                    const std::string& camera, const std::string& session = "") {
  const auto found = std::ranges::find_if(snapshot.tracks, [&](const RowCollection::Track& track) {
    return track.camera == camera && (session.empty() || track.session_id == session);
  });
  EXPECT_NE(found, snapshot.tracks.end());
  return *found;
}

std::multiset<int64_t> Times(const RowCollection::Snapshot& snapshot, const std::string& camera,
                             const std::string& session = "") {
  std::multiset<int64_t> times;
  for (const ObservationBatch& batch : TrackOf(snapshot, camera, session).rows) {
    times.insert(batch.time_ns.begin(), batch.time_ns.end());
  }
  return times;
}

SessionCamera CameraNamed(const std::string& name) {
  SessionCamera camera;
  camera.description.camera = name;
  return camera;
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
  for (const ObservationBatch& batch : TrackOf(*snapshot, "left").rows) {
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
  for (const ObservationBatch& batch : TrackOf(*snapshot, "right").rows) {
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

TEST(RowCollection, TakesWhatASessionHasFromBefore) {
  RowCollection rows;
  const StreamKey before{"first", "left", 7}, own{"s", "left", 1};
  SessionCamera camera = CameraNamed("left");
  camera.description.latency_s = 0.25;
  // In between: rows that come now are not held up.
  rows.Add(own, Rows(own, 100, 50, 50));
  rows.AddEarlier("s", camera, Rows(before, 0, 50, 50));
  rows.Add(own, Rows(own, 101, 50, 50));
  rows.AddEarlier("s", camera, Rows(before, 1, 50, 50));
  const auto snapshot = rows.Take("s");
  ASSERT_TRUE(snapshot);
  ASSERT_EQ(snapshot->tracks.size(), 2u);
  EXPECT_EQ(Times(*snapshot, "left", "first").size(), 100u);
  EXPECT_EQ(Times(*snapshot, "left", "s").size(), 100u);
  EXPECT_EQ(snapshot->seen_count, 200u);
  EXPECT_EQ(TrackOf(*snapshot, "left", "first").description, camera.description);
  EXPECT_FALSE(TrackOf(*snapshot, "left", "s").description.has_value());
  EXPECT_THAT(rows.Sessions(), ElementsAre("s"));
}

TEST(RowCollection, RowsFromBeforeARestartAreOfTheSameTrack) {
  RowCollection rows;
  const StreamKey left{"s", "left", 1};
  rows.Add(left, Rows(left, 100, 50, 50));
  rows.AddEarlier("s", CameraNamed("left"), Rows(left, 0, 50, 50));
  const auto snapshot = rows.Take("s");
  ASSERT_EQ(snapshot->tracks.size(), 1u);
  EXPECT_EQ(Times(*snapshot, "left").size(), 100u);
  EXPECT_EQ(snapshot->tracks[0].rows.front().time_ns.front(), 0);
}

TEST(RowCollection, MemoryIsBoundedWithRowsFromBefore) {
  RowCollection rows({.max_rows_per_camera = 500});
  const StreamKey before{"first", "left", 1}, own{"s", "left", 1};
  for (int i = 0; i < 100; ++i) {
    rows.AddEarlier("s", CameraNamed("left"), Rows(before, i, 50, 50));
    rows.Add(own, Rows(own, 1000 + i, 50, 50));
  }
  const auto snapshot = rows.Take("s");
  const size_t earlier = Times(*snapshot, "left", "first").size();
  const size_t newer = Times(*snapshot, "left", "s").size();
  EXPECT_LE(earlier + newer, 550u);
  EXPECT_GT(earlier, 80u);
  EXPECT_GT(newer, 80u);
}

}  // namespace
}  // namespace rigcal::server::row_collection_test
