// SPDX-License-Identifier: Apache-2.0
// Points as frames of one rate, and the files that hold them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "client/results/c3d_file.h"
#include "client/results/point_frames.h"
#include "client/results/trc_file.h"
#include "tests/client/results/c3d_reader.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::client::motion_capture_files_test {
namespace {

using ::rigcal::testing::C3dContent;
using ::rigcal::testing::C3dPoint;
using ::rigcal::testing::ReadC3d;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int64_t kStartNs = 1'700'000'000'000'000'000;

TriangulatedPoint PointAt(int64_t time_ns, int marker) {
  TriangulatedPoint point;
  point.rig_time_ns = time_ns;
  point.marker = marker;
  const double t = 1e-9 * static_cast<double>(time_ns - kStartNs);
  point.position_m = {0.1 * marker + t, -1.5, 4 + 0.01 * marker};
  point.noise_m2 = 1e-6 * Eigen::Matrix3d::Identity();
  for (const int camera : {0, 2, 9}) point.views.push_back({.camera = camera});
  return point;
}

// Two markers at 50 Hz; marker 1 has none in frame 1, and frame 2 is missing.
Triangulation FiveFrames() {
  Triangulation triangulation;
  for (const int frame : {0, 1, 3, 4}) {
    const int64_t time_ns = kStartNs + 20'000'000 * frame + (frame == 1 ? 900'000 : 0);
    triangulation.points.push_back(PointAt(time_ns, 0));
    if (frame != 1) triangulation.points.push_back(PointAt(time_ns, 1));
  }
  return triangulation;
}

TEST(PointFrames, PutEachPointIntoItsFrame) {
  const Triangulation triangulation = FiveFrames();
  const auto frames = FramesOf(triangulation, {"tip", "end"});
  ASSERT_TRUE(frames.ok()) << frames.status();
  EXPECT_NEAR(frames->rate_hz, 50, 1e-9);
  EXPECT_EQ(frames->first_ns, kStartNs);
  EXPECT_EQ(frames->frame_count, 5u);
  const auto& points = triangulation.points;
  EXPECT_THAT(frames->points, ElementsAre(&points[0], &points[1], &points[2], nullptr, nullptr,
                                          nullptr, &points[3], &points[4], &points[5], &points[6]));
}

std::string WhyNoFrames(const std::vector<int64_t>& times_ns) {
  Triangulation triangulation;
  for (const int64_t time_ns : times_ns) triangulation.points.push_back(PointAt(time_ns, 0));
  const auto frames = FramesOf(triangulation, {"tip"});
  EXPECT_EQ(frames.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(frames.status().message()), HasSubstr("write CSV or Parquet"));
  return std::string(frames.status().message());
}

TEST(PointFrames, RefuseInstantsWithoutARate) {
  EXPECT_THAT(WhyNoFrames({}), HasSubstr("of 0 instants there is none"));
  EXPECT_THAT(WhyNoFrames({5}), HasSubstr("of 1 instants there is none"));
  EXPECT_THAT(WhyNoFrames({0, 100, 140, 240, 340, 440}), HasSubstr("% of a period"));
  EXPECT_THAT(WhyNoFrames({0, 1, 2, int64_t{1} << 40}), HasSubstr("there is a pause of"));
  // Two cameras that run freely give two instants in a period.
  EXPECT_THAT(WhyNoFrames({0, 100, 200, 201, 300, 301, 400, 500}), HasSubstr("of a period"));
}

TEST(TrcFile, HasHeaderAndRowsAsDocumented) {
  const Triangulation triangulation = FiveFrames();
  const std::string text = TrcFile(*FramesOf(triangulation, {"tip", "end"}), "points.trc");
  const std::vector<std::string> lines = absl::StrSplit(text, '\n');
  ASSERT_EQ(lines.size(), 12u);
  EXPECT_EQ(lines[0], "PathFileType\t4\t(X/Y/Z)\tpoints.trc");
  EXPECT_THAT(lines[1], HasSubstr("DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\t"));
  EXPECT_EQ(lines[2], "50\t50\t5\t2\tmm\t50\t1\t5");
  EXPECT_EQ(lines[3], "Frame#\tTime\ttip\t\t\tend\t\t");
  EXPECT_EQ(lines[4], "\t\tX1\tY1\tZ1\tX2\tY2\tZ2");
  EXPECT_EQ(lines[5], "");
  EXPECT_EQ(lines[6],
            "1\t0.000000\t0.00000\t-1500.00000\t4000.00000\t100.00000\t-1500.00000\t4010.00000");
  EXPECT_EQ(lines[7], "2\t0.020000\t20.90000\t-1500.00000\t4000.00000\t\t\t");
  EXPECT_EQ(lines[8], "3\t0.040000\t\t\t\t\t\t");
  EXPECT_EQ(lines[11], "");
  for (size_t i = 6; i < 11; ++i) {
    EXPECT_EQ(std::vector<std::string>(absl::StrSplit(lines[i], '\t')).size(), 8u) << lines[i];
  }
}

TEST(C3dFile, ReadsBackByTheFormatsDocumentation) {
  const Triangulation triangulation = FiveFrames();
  const auto file = C3dFile(*FramesOf(triangulation, {"tip", "the_end"}), "c-000007");
  ASSERT_TRUE(file.ok()) << file.status();
  const C3dContent content = ReadC3d(*file);
  EXPECT_EQ(content.points, 2);
  EXPECT_EQ(content.first_frame, 1);
  EXPECT_EQ(content.last_frame, 5);
  EXPECT_EQ(content.rate_hz, 50);
  const auto& parameters = content.parameters;
  EXPECT_THAT(parameters.at("POINT:USED").Words(), ElementsAre(2));
  EXPECT_THAT(parameters.at("POINT:FRAMES").Words(), ElementsAre(5));
  EXPECT_THAT(parameters.at("POINT:DATA_START").Words(), ElementsAre(content.data_block));
  EXPECT_EQ(parameters.at("POINT:SCALE").Float(), content.scale);
  EXPECT_NEAR(content.scale, -4010.0 / 32000, 1e-6);
  EXPECT_EQ(parameters.at("POINT:RATE").Float(), 50);
  EXPECT_THAT(parameters.at("POINT:UNITS").Texts(), ElementsAre("mm"));
  EXPECT_THAT(parameters.at("POINT:LABELS").Texts(), ElementsAre("tip", "the_end"));
  EXPECT_THAT(parameters.at("ANALOG:USED").Words(), ElementsAre(0));
  EXPECT_THAT(parameters.at("RIGCAL:CALIBRATION").Texts(), ElementsAre("c-000007"));
  EXPECT_THAT(parameters.at("RIGCAL:FIRST_TIME_NS").Texts(), ElementsAre(absl::StrCat(kStartNs)));
  EXPECT_FALSE(parameters.contains("TRIAL:ACTUAL_END_FIELD"));
  ASSERT_EQ(content.frames.size(), 5u);
  const C3dPoint& end = content.frames[3][1];
  EXPECT_THAT(end.position, ElementsAre(160.0f, -1500.0f, 4010.0f));
  // Cameras 0 and 2; the tenth has no bit. The residual is one sigma, 1.73 mm.
  EXPECT_EQ(end.word >> 8, 0b101);
  EXPECT_NEAR(-content.scale * (end.word & 0xff), std::sqrt(3.0), 0.07);
  EXPECT_EQ(content.frames[1][1].word, -1);
  EXPECT_EQ(content.frames[2][0].word, -1);
}

TEST(C3dFile, HasMoreLabelsThanAParameterHolds) {
  Triangulation triangulation;
  std::vector<std::string> labels;
  for (int marker = 0; marker < 600; ++marker) {
    labels.push_back(absl::StrCat("marker_", marker));
    for (const int frame : {0, 1}) {
      triangulation.points.push_back(PointAt(kStartNs + 20'000'000 * frame, marker));
    }
  }
  const C3dContent content = ReadC3d(*C3dFile(*FramesOf(triangulation, labels), "c-000001"));
  std::vector<std::string> read;
  for (const char* name : {"POINT:LABELS", "POINT:LABELS2", "POINT:LABELS3"}) {
    const std::vector<std::string> part = content.parameters.at(name).Texts();
    EXPECT_LE(part.size(), 255u);
    read.insert(read.end(), part.begin(), part.end());
  }
  EXPECT_EQ(read, labels);
  EXPECT_FALSE(content.parameters.contains("POINT:LABELS4"));
  EXPECT_EQ(content.frames[1][599].position[2], 9990.0f);
}

TEST(C3dFile, CountsMoreFramesThanAWordHolds) {
  Triangulation triangulation;
  for (int frame = 0; frame < 70'000; ++frame) {
    triangulation.points.push_back(PointAt(kStartNs + int64_t{2'000'000} * frame, 0));
  }
  const C3dContent content = ReadC3d(*C3dFile(*FramesOf(triangulation, {"tip"}), "c-000001"));
  EXPECT_EQ(content.last_frame, 65535);
  EXPECT_THAT(content.parameters.at("POINT:FRAMES").Words(), ElementsAre(65535));
  EXPECT_EQ(content.parameters.at("POINT:LONG_FRAMES").Float(), 70'000);
  EXPECT_THAT(content.parameters.at("TRIAL:ACTUAL_START_FIELD").Words(), ElementsAre(1, 0));
  ASSERT_EQ(content.frames.size(), 70'000u);
  EXPECT_NEAR(content.frames.back()[0].position[0], 139'998, 0.02);
}

TEST(C3dFile, RefusesLabelsThatItCannotHold) {
  const Triangulation triangulation = FiveFrames();
  const auto frames = FramesOf(triangulation, {"tip", std::string(128, 'x')});
  EXPECT_THAT(std::string(C3dFile(*frames, "").status().message()),
              HasSubstr("too long for a C3D file"));
}

}  // namespace
}  // namespace rigcal::client::motion_capture_files_test
