// SPDX-License-Identifier: Apache-2.0
#include "client/results/trajectory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::client::trajectory_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(ReadTrajectories, ReadsColumnsByName) {
  const TemporaryDirectory directory;
  const auto path = directory.WriteFile(
      "a.csv",
      "# made by hand\nz_m,label,sigma,time_s,x_m,y_m\n3,a,0,0.5,1,2\n6,b,0,0.5,4,5\n"
      "nan,a,0,0.6,1,2\n,a,0,0.7,,\n9,a,0,0.1,7,8\r\n");
  ASSERT_OK_AND_ASSIGN(const Trajectories read, ReadTrajectories(path.string()));
  ASSERT_EQ(read.size(), 2u);
  ASSERT_EQ(read.at("a").size(), 2u);
  EXPECT_EQ(read.at("a")[0].time_s, 0.1);
  EXPECT_EQ(read.at("a")[0].position_m, Eigen::Vector3d(7, 8, 9));
  EXPECT_EQ(read.at("b")[0].position_m, Eigen::Vector3d(4, 5, 6));
}

TEST(ReadTrajectories, ReadsTheTablesOfOtherPrograms) {
  const TemporaryDirectory directory;
  const std::pair<const char*, const char*> files[] = {
      {"Time,X,Y,Z\n0.5,1,2,3\n", ""},
      {"time_ms;x_mm;y_mm;z_mm\n500;1000,0;2000,0;3000,0\n", ""},
      {"Time (ms)\tX [mm]\tY [mm]\tZ [mm]\tMarker\n500\t1000\t2000\t3000\tm\n", "m"},
      {"# tum\n0.5 1 2 3 0 0 0 1\n", ""},
      {"\xef\xbb\xbftime_s, x_m, y_m, z_m\n0.5, 1, 2, 3\n", ""},
      {"Format Version,1.23,Take Name,t,Length Units,Millimeters\n\n,,Marker,Marker,Marker\n"
       ",,m1,m1,m1\n,,1,1,1\n,,Position,Position,Position\nFrame,Time (Seconds),X,Y,Z\n"
       "0,0.5,1000,2000,3000\n1,0.6,,,\n",
       "m1"}};
  for (const auto& [text, label] : files) {
    const auto path = directory.WriteFile("other", text);
    ASSERT_OK_AND_ASSIGN(const Trajectories read, ReadTrajectories(path.string()));
    ASSERT_EQ(read.count(label), 1u) << text;
    ASSERT_EQ(read.at(label).size(), 1u) << text;
    EXPECT_DOUBLE_EQ(read.at(label)[0].time_s, 0.5) << text;
    EXPECT_TRUE(read.at(label)[0].position_m.isApprox(Eigen::Vector3d(1, 2, 3))) << text;
  }
}

TEST(ReadTrajectories, NamesFileAndLineOfEveryFault) {
  const TemporaryDirectory directory;
  const std::pair<const char*, const char*> faults[] = {
      {"time_s,x_m,y_m\n", "line 1: the header"},
      {"t,x,y,z\n0,1,2,3\nx,1,2,3\n", "line 3: the time"},
      {"t,x,y,z\n0,1,2,three\n", "line 2: a coordinate"},
      {"t,x,y,z\n0,1,2,inf\n", "line 2: a coordinate"},
      {"t,x,y,z\n", "has no positions"},
      {"t,x,y,z\n0,1,2,3\n0,1,2,4\n", "two positions at time 0"}};
  for (const auto& [text, says] : faults) {
    const auto path = directory.WriteFile("bad.csv", text);
    EXPECT_THAT(
        ReadTrajectories(path.string()),
        StatusIs(absl::StatusCode::kInvalidArgument, AllOf(HasSubstr("bad.csv"), HasSubstr(says))));
  }
  EXPECT_THAT(ReadTrajectories("/nowhere/a.csv"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("/nowhere/a.csv")));
}

TEST(PositionAt, FollowsAParabolaBetweenRows) {
  std::vector<TrajectoryPoint> rows;
  for (int i = 0; i < 8; ++i) {
    const double t = 0.1 * i;
    rows.push_back({t, Eigen::Vector3d(t, t * t, 1 - t * t)});
  }
  const auto between = PositionAt(rows, 0.237, 0.11);
  ASSERT_TRUE(between.has_value());
  EXPECT_NEAR(between->x(), 0.237, 1e-12);
  EXPECT_NEAR(between->y(), 0.237 * 0.237, 1e-12);
  EXPECT_NEAR(between->z(), 1 - 0.237 * 0.237, 1e-12);
  EXPECT_EQ(*PositionAt(rows, 0, 0.11), rows[0].position_m);
  EXPECT_FALSE(PositionAt(rows, -0.01, 0.11).has_value());
  EXPECT_FALSE(PositionAt(rows, 0.71, 0.11).has_value());
  EXPECT_FALSE(PositionAt(rows, 0.237, 0.05).has_value()) << "in a gap";
}

}  // namespace
}  // namespace rigcal::client::trajectory_test
