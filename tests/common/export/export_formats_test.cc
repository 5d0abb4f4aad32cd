// SPDX-License-Identifier: Apache-2.0
// Every format through a reader that knows nothing of its writer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <set>

#include "common/camera/camera_model.h"
#include "common/export/calibration_export.h"
#include "common/wire/camera_wire.h"
#include "tests/common/export/export_readers.h"
#include "tests/common/export/exported_rigs.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::export_formats_test {
namespace {

using ::rigcal::testing::CalibrationOfLens;
using ::rigcal::testing::ReadCamera;
using ::rigcal::testing::ReadCameras;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TestLens;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr TestLens kLenses[] = {TestLens::kPinhole, TestLens::kBrown4, TestLens::kBrown5,
                                TestLens::kRational, TestLens::kFisheye};
constexpr const char* kLensNames[] = {"pinhole", "brown4", "brown5", "rational", "fisheye"};

struct FormatCase {
  const char* format;
  ReadCameras (*read)(const testing::ExportedFiles&);
  std::set<TestLens> refused;
  const char* reason = "";  // of the refusal
  bool square = false;      // one focal length
};

void PrintTo(const FormatCase& value, std::ostream* out) { *out << value.format; }

const std::set<TestLens> kDistorted = {TestLens::kBrown4, TestLens::kBrown5, TestLens::kRational,
                                       TestLens::kFisheye};

const FormatCase kCases[] = {
    {"opencv", &testing::ReadOpenCvYaml, {}},
    {"kalibr",
     &testing::ReadKalibrCamchain,
     {TestLens::kBrown5, TestLens::kRational},
     "--undistorted"},
    {"ros", &testing::ReadRosFiles, {}},
    {"colmap", &testing::ReadColmapText, {}},
    {"colmap-binary", &testing::ReadColmapBinary, {}},
    {"nerfstudio", &testing::ReadNerfstudioJson, {TestLens::kRational}, "--undistorted"},
    {"anipose", &testing::ReadAniposeToml, {}},
    {"pose2sim", &testing::ReadPose2SimToml, {TestLens::kFisheye}, "fisheye"},
    {"caliscope", &testing::ReadCaliscopeToml, {}},
    {"mcap", &testing::ReadMcapFile, {}},
    {"mrcal", &testing::ReadMrcalModels, {TestLens::kFisheye}, "fisheye"},
    {"openmvg", &testing::ReadOpenMvgJson, {TestLens::kRational}, "--undistorted", true},
    {"matlab", &testing::ReadMatFile, {}},
    {"blender", &testing::ReadBlenderScript, kDistorted, "--undistorted"},
    {"usd", &testing::ReadUsda, kDistorted, "--undistorted"},
};

const CalibrationExportFormat& FormatOf(const FormatCase& value) {
  return **FindCalibrationExportFormat(value.format);
}

// Points seen all over the image, 0.5 to 10 m away, in the rig frame, with their pixels.
struct SeenPoint {
  Eigen::Vector3d x_in_rig;
  Eigen::Vector2d pixel;
};

std::vector<SeenPoint> PointsOver(const v1::CalibratedCamera& proto, int count) {
  const Intrinsics intrinsics = *wire::FromProto(proto.intrinsics());
  const RigidTransform rig_from_cam = wire::FromProto(proto.cam_from_rig())->Inverse();
  std::mt19937 random(7);
  std::uniform_real_distribution<double> u(-0.5, proto.image_size_px().width() - 0.5);
  std::uniform_real_distribution<double> v(-0.5, proto.image_size_px().height() - 0.5);
  std::uniform_real_distribution<double> distance_m(0.5, 10);
  std::vector<SeenPoint> points;
  while (static_cast<int>(points.size()) < count) {
    const Eigen::Vector2d pixel(u(random), v(random));
    const absl::StatusOr<Eigen::Vector2d> ray = Undistort(intrinsics, pixel);
    EXPECT_TRUE(ray.ok()) << "the test's lens has no inverse at " << pixel.transpose();
    if (!ray.ok()) return points;
    const Eigen::Vector3d in_cam = distance_m(random) * ray->homogeneous().normalized();
    SeenPoint point{rig_from_cam * in_cam, {}};
    EXPECT_TRUE(Project(intrinsics, rig_from_cam.Inverse() * point.x_in_rig, &point.pixel));
    EXPECT_LT((point.pixel - pixel).norm(), 1e-3);
    points.push_back(point);
  }
  return points;
}

class ExportFormat : public ::testing::TestWithParam<FormatCase> {};

// 0.01 px: what double numbers hold with room; USD's are single.
constexpr double kWithinPx = 0.01;

TEST_P(ExportFormat, ProjectsAsWeDoOrSaysWhyNot) {
  const FormatCase& value = GetParam();
  for (size_t i = 0; i < std::size(kLenses); ++i) {
    SCOPED_TRACE(kLensNames[i]);
    const v1::Calibration calibration =
        CalibrationOfLens(kLenses[i], {"left", "right", "top"}, value.square);
    const auto files = FormatOf(value).make(calibration, {.max_error_px = 0});
    if (value.refused.contains(kLenses[i])) {
      EXPECT_THAT(files, StatusIs(absl::StatusCode::kFailedPrecondition,
                                  AllOf(HasSubstr("camera left: "), HasSubstr(value.reason))));
      continue;
    }
    ASSERT_THAT(files, testing::IsOk());
    ReadCameras read;
    ASSERT_NO_THROW(read = value.read(*files));
    ASSERT_EQ(read.size(), 3u);
    for (int k = 0; k < 3; ++k) {
      const v1::CalibratedCamera& camera = calibration.cameras(k);
      const ReadCamera& seen = read[static_cast<size_t>(k)];
      EXPECT_EQ(seen.name, camera.camera());
      EXPECT_EQ(seen.width_px, camera.image_size_px().width());
      EXPECT_EQ(seen.height_px, camera.image_size_px().height());
      double worst_px = 0;
      for (const SeenPoint& point : PointsOver(camera, 1000)) {
        const double error_px = (seen.project(point.x_in_rig) - point.pixel).norm();
        if (!(error_px <= worst_px)) worst_px = error_px;
      }
      EXPECT_LT(worst_px, kWithinPx) << camera.camera();
    }
  }
}

TEST_P(ExportFormat, KeepsNamesThatLookLikeSomethingElse) {
  const FormatCase& value = GetParam();
  // Truth values, numbers, signs, file extensions, other words of the formats; sorted, as the
  // cameras of a calibration are. Of a.b, a-b and a_b a format may make the same.
  const std::vector<std::string> names = {"-",     "-x",  "0",     "0.5", "0x1F",
                                          "1e5",   "CON", "_",     "a-b", "a.b",
                                          "a.png", "a_b", "cam_1", "inf", "metadata",
                                          "null",  "rig", "true",  "yes", std::string(64, 'z')};
  const v1::Calibration calibration = CalibrationOfLens(TestLens::kPinhole, names, value.square);
  ASSERT_OK_AND_ASSIGN(const auto files, FormatOf(value).make(calibration));
  ReadCameras read;
  ASSERT_NO_THROW(read = value.read(files));
  std::vector<std::string> read_names;
  for (const ReadCamera& camera : read) read_names.push_back(camera.name);
  EXPECT_EQ(read_names, names);
  std::set<std::string> file_names;
  for (const ExportFile& file : files)
    EXPECT_TRUE(file_names.insert(file.name).second) << file.name;
}

TEST_P(ExportFormat, RefusesNamesThatCouldBreakAFile) {
  for (const char* name : {"a b", "a\"b", "a'b", "a/b", "../a", "", ".a", "a\nb", "caf\xc3\xa9",
                           "\xff", "a\\b", "a$(arg x)", "a;b"}) {
    SCOPED_TRACE(name);
    const v1::Calibration calibration = CalibrationOfLens(TestLens::kPinhole, {name, "right"});
    EXPECT_THAT(FormatOf(GetParam()).make(calibration),
                StatusIs(absl::StatusCode::kDataLoss, HasSubstr("camera name")));
  }
}

TEST_P(ExportFormat, IsTheSameEveryTime) {
  const v1::Calibration calibration =
      CalibrationOfLens(TestLens::kPinhole, {"left", "right"}, GetParam().square);
  ASSERT_OK_AND_ASSIGN(const auto first, FormatOf(GetParam()).make(calibration));
  ASSERT_OK_AND_ASSIGN(const auto second, FormatOf(GetParam()).make(calibration));
  ASSERT_EQ(first.size(), second.size());
  for (size_t i = 0; i < first.size(); ++i) EXPECT_EQ(first[i].content, second[i].content);
}

INSTANTIATE_TEST_SUITE_P(All, ExportFormat, ::testing::ValuesIn(kCases), [](const auto& test) {
  std::string name = test.param.format;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

TEST(ExportFormats, AreAllReadHere) {
  std::set<std::string> cases = {"json"};
  for (const FormatCase& value : kCases) cases.insert(value.format);
  for (const CalibrationExportFormat& format : CalibrationExportFormats()) {
    EXPECT_TRUE(cases.contains(format.name)) << format.name << " has no reader in this test";
  }
}

TEST(ExportFormats, KalibrHasClockOffsetsThatAreConstant) {
  v1::Calibration calibration = CalibrationOfLens(TestLens::kPinhole, {"left", "right"});
  calibration.mutable_cameras(1)->set_time_offset_s(-0.0125);
  const CalibrationExportFormat& kalibr = **FindCalibrationExportFormat("kalibr");
  ASSERT_OK_AND_ASSIGN(auto files, kalibr.make(calibration));
  EXPECT_EQ(testing::ReadKalibrCamchain(files)[1].time_offset_s, -0.0125);
  calibration.mutable_cameras(1)->set_time_rate_ppm(3);
  ASSERT_OK_AND_ASSIGN(files, kalibr.make(calibration));
  EXPECT_EQ(testing::ReadKalibrCamchain(files)[1].time_offset_s, 0);
  EXPECT_THAT(files[0].content, HasSubstr("# no timeshift_cam_imu"));
  calibration.mutable_cameras(1)->set_time_rate_ppm(0);
  v1::ClockCoursePoint* const jump = calibration.mutable_cameras(1)->add_clock_course();
  jump->set_camera_time_ns(5'000'000'000);
  jump->set_offset_s(-0.03);
  ASSERT_OK_AND_ASSIGN(files, kalibr.make(calibration));
  EXPECT_EQ(testing::ReadKalibrCamchain(files)[1].time_offset_s, 0);
  EXPECT_THAT(files[0].content, HasSubstr("this clock jumped or drifted"));
}

TEST(ExportFormats, NerfstudioRefusesARigOfTwoKindsOfLenses) {
  v1::Calibration calibration = CalibrationOfLens(TestLens::kPinhole, {"left", "right"});
  *calibration.mutable_cameras(1) =
      CalibrationOfLens(TestLens::kFisheye, {"left", "right"}).cameras(1);
  EXPECT_THAT((*FindCalibrationExportFormat("nerfstudio"))->make(calibration),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("camera right: "), HasSubstr("one lens model"))));
}

TEST(ExportFormats, OpenMvgRefusesTwoFocalLengthsThatMatter) {
  v1::Calibration calibration = CalibrationOfLens(TestLens::kBrown5, {"left"});
  const CalibrationExportFormat& openmvg = **FindCalibrationExportFormat("openmvg");
  EXPECT_THAT(openmvg.make(calibration),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("camera left: "), HasSubstr("wrong by up to"))));
  // Less than can be seen: held, and within 0.05 px.
  v1::Intrinsics* const intrinsics = calibration.mutable_cameras(0)->mutable_intrinsics();
  intrinsics->set_fy_px(intrinsics->fx_px() + 0.1);
  ASSERT_OK_AND_ASSIGN(const auto files, openmvg.make(calibration));
  const ReadCamera read = testing::ReadOpenMvgJson(files)[0];
  for (const SeenPoint& point : PointsOver(calibration.cameras(0), 1000)) {
    EXPECT_LT((read.project(point.x_in_rig) - point.pixel).norm(), 0.05);
  }
}

// The error that is told is what the file shows wrong, and no more than was allowed.
TEST(ExportFormats, RefitALensWithinTheErrorThatIsTold) {
  const std::pair<const char*, TestLens> refits[] = {{"kalibr", TestLens::kBrown5},
                                                     {"nerfstudio", TestLens::kRational},
                                                     {"openmvg", TestLens::kBrown5}};
  for (const auto& [name, lens] : refits) {
    SCOPED_TRACE(name);
    v1::Calibration calibration = CalibrationOfLens(lens, {"left"}, true);
    v1::Intrinsics* const intrinsics = calibration.mutable_cameras(0)->mutable_intrinsics();
    intrinsics->set_fy_px(intrinsics->fx_px() * 1.0004);
    std::vector<LensNote> notes;
    ASSERT_OK_AND_ASSIGN(
        const auto files,
        (*FindCalibrationExportFormat(name))->make(calibration, {.max_error_px = 20}, &notes));
    ASSERT_EQ(notes.size(), 1u);
    EXPECT_EQ(notes[0].camera, "left");
    for (const FormatCase& value : kCases) {
      if (std::string(value.format) != name) continue;
      const ReadCamera read = value.read(files)[0];
      double worst_px = 0;
      for (const SeenPoint& point : PointsOver(calibration.cameras(0), 1000)) {
        worst_px = std::max(worst_px, (read.project(point.x_in_rig) - point.pixel).norm());
      }
      EXPECT_LE(worst_px, notes[0].error_px + 0.01);
      EXPECT_GT(worst_px, 0.1 * notes[0].error_px);
    }
    // A little less than that is refused, with the figure.
    EXPECT_THAT((*FindCalibrationExportFormat(name))
                    ->make(calibration, {.max_error_px = 0.99 * notes[0].error_px}),
                StatusIs(absl::StatusCode::kFailedPrecondition,
                         AllOf(HasSubstr("wrong by up to"), HasSubstr("--undistorted"))));
  }
}

TEST(ExportFormats, SayWhichAxisPointsUp) {
  const v1::Calibration calibration = CalibrationOfLens(TestLens::kPinhole, {"left"});
  const CalibrationExportFormat& usd = **FindCalibrationExportFormat("usd");
  EXPECT_THAT(usd.make(calibration, {.up = UpAxis::kZ})->at(0).content,
              HasSubstr("upAxis = \"Z\""));
  EXPECT_THAT(usd.make(calibration, {.up = UpAxis::kY})->at(0).content,
              HasSubstr("upAxis = \"Y\""));
  // The camera looks along the rig's z; of a rig with y up that is Blender's -y.
  const CalibrationExportFormat& blender = **FindCalibrationExportFormat("blender");
  EXPECT_THAT(blender.make(calibration, {.up = UpAxis::kZ})->at(0).content,
              HasSubstr("[0.0, 0.0, -1.0, 0.0], [0.0, 0.0, 0.0, 1.0]"));
  EXPECT_NE(blender.make(calibration, {.up = UpAxis::kY})->at(0).content,
            blender.make(calibration, {.up = UpAxis::kZ})->at(0).content);
}

TEST(ExportFormats, RefuseValuesThatAreNotFinite) {
  v1::Calibration calibration = CalibrationOfLens(TestLens::kPinhole, {"left", "right"});
  calibration.mutable_cameras(1)->set_time_offset_s(std::nan(""));
  for (const FormatCase& value : kCases) {
    EXPECT_THAT(FormatOf(value).make(calibration),
                StatusIs(absl::StatusCode::kDataLoss,
                         AllOf(HasSubstr("camera right"), HasSubstr("not finite"))))
        << value.format;
  }
}

}  // namespace
}  // namespace rigcal::export_formats_test
