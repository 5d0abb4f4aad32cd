// SPDX-License-Identifier: Apache-2.0
#include "common/import/import_readers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "absl/strings/str_replace.h"
#include "common/camera/camera_model.h"
#include "common/export/calibration_export.h"
#include "common/wire/camera_wire.h"
#include "tests/common/export/exported_rigs.h"
#include "tests/common/import/imported_texts.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::import_readers_test {
namespace {

using ::rigcal::testing::CalibrationOfLens;
using ::rigcal::testing::QtmText;
using ::rigcal::testing::RingOfCameras;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::rigcal::testing::TestLens;
using ::rigcal::testing::TheiaText;
using ::rigcal::testing::ViconText;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

const std::vector<double> kDistortion = {-0.12, 0.03, 0.0011, -0.0007, -0.004};

// The worst difference of two cameras for points all over the first one's image.
double WorstDifferencePx(const ImportedCamera& a, const ImportedCamera& b) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> share(0, 1), distance_m(0.5, 10);
  double worst = 0;
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector2d pixel(share(random) * a.image_size_px.width - 0.5,
                                share(random) * a.image_size_px.height - 0.5);
    const absl::StatusOr<Eigen::Vector2d> ray = Undistort(a.intrinsics, pixel);
    EXPECT_TRUE(ray.ok());
    if (!ray.ok()) return 1e9;
    const Eigen::Vector3d x = a.cam_from_rig->Inverse() *
                              Eigen::Vector3d(distance_m(random) * ray->homogeneous().normalized());
    Eigen::Vector2d seen(1e9, 1e9);
    Project(b.intrinsics, *b.cam_from_rig * x, &seen);
    worst = std::max(worst, (seen - pixel).norm());
  }
  return worst;
}

void ExpectSame(const std::vector<ImportedCamera>& expected, const ImportedRig& rig,
                double within_px) {
  ASSERT_EQ(rig.cameras.size(), expected.size());
  for (size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(rig.cameras[i].name, expected[i].name);
    EXPECT_EQ(rig.cameras[i].image_size_px, expected[i].image_size_px);
    ASSERT_TRUE(rig.cameras[i].cam_from_rig.has_value());
    EXPECT_LT(WorstDifferencePx(expected[i], rig.cameras[i]), within_px) << expected[i].name;
  }
}

std::vector<ImportedCamera> CamerasOf(const v1::Calibration& calibration) {
  std::vector<ImportedCamera> cameras;
  for (const v1::CalibratedCamera& proto : calibration.cameras()) {
    cameras.push_back({.name = proto.camera(),
                       .image_size_px = wire::FromProto(proto.image_size_px()),
                       .intrinsics = *wire::FromProto(proto.intrinsics()),
                       .cam_from_rig = *wire::FromProto(proto.cam_from_rig()),
                       .time_offset_s = proto.time_offset_s()});
  }
  return cameras;
}

struct OwnFormat {
  const char* format;
  const char* file;  // empty: the folder
  std::vector<TestLens> lenses;
};

// Why a rig, or the first camera of it that is left out, cannot be read.
absl::Status FirstFault(const absl::StatusOr<ImportedRig>& rig) {
  if (!rig.ok() || rig->left_out.empty()) return rig.status();
  return absl::InvalidArgumentError(rig->left_out.front().why);
}

TEST(ReadCalibrationFile, ReadsWhatWeExport) {
  const std::vector<TestLens> all = {TestLens::kPinhole, TestLens::kBrown4, TestLens::kBrown5,
                                     TestLens::kRational, TestLens::kFisheye};
  const OwnFormat formats[] = {
      {"opencv", "", all},
      {"kalibr", "camchain.yaml", {TestLens::kPinhole, TestLens::kBrown4, TestLens::kFisheye}},
      {"caliscope", "camera_array.toml", all},
      {"anipose", "calibration.toml", all}};
  for (const OwnFormat& own : formats) {
    for (const TestLens lens : own.lenses) {
      SCOPED_TRACE(std::string(own.format) + " " + std::to_string(static_cast<int>(lens)));
      const TemporaryDirectory directory;
      const v1::Calibration calibration = CalibrationOfLens(lens, {"left", "right"});
      ASSERT_OK_AND_ASSIGN(const auto files,
                           (*FindCalibrationExportFormat(own.format))->make(calibration));
      for (const ExportFile& file : files) directory.WriteFile(file.name, file.content);
      ASSERT_OK_AND_ASSIGN(const ImportedRig rig,
                           ReadCalibrationFile((directory.path() / own.file).string()));
      ExpectSame(CamerasOf(calibration), rig, 0.01);
      EXPECT_THAT(rig.notes, IsEmpty());
      if (std::string(own.format) == "kalibr") {
        EXPECT_EQ(rig.cameras[1].time_offset_s, 0.002);
      }
    }
  }
}

TEST(ReadKalibr, FollowsTheChainWhereThereIsNoImu) {
  const std::vector<ImportedCamera> cameras = [] {
    auto ring = RingOfCameras(4, {-0.12, 0.03, 0.0011, -0.0007, 0});
    for (size_t i = 0; i < ring.size(); ++i) ring[i].name = "cam" + std::to_string(i);
    return ring;
  }();
  std::string text;
  for (size_t i = 0; i < cameras.size(); ++i) {
    text += "cam" + std::to_string(i) + ":\n";
    if (i > 0) {
      const Eigen::Matrix4d step =
          (*cameras[i].cam_from_rig * cameras[i - 1].cam_from_rig->Inverse()).Matrix();
      text += "  T_cn_cnm1:\n";
      for (int row = 0; row < 4; ++row) {
        text += "  - [";
        for (int col = 0; col < 4; ++col) {
          text += (col > 0 ? ", " : "") + std::to_string(step(row, col));
        }
        text += "]\n";
      }
    }
    text +=
        "  camera_model: pinhole\n  distortion_coeffs: [-0.12, 0.03, 0.0011, -0.0007]\n"
        "  distortion_model: radtan\n  intrinsics: [" +
        std::to_string(cameras[i].intrinsics.fx_px) + ", " +
        std::to_string(cameras[i].intrinsics.fy_px) +
        ", 955.25, 548.5]\n  resolution: [1920, 1088]\n  rostopic: /camera\n";
  }
  ASSERT_OK_AND_ASSIGN(const ImportedRig rig, ReadKalibr("chain.yaml", text));
  // The first camera is the rig; std::to_string has 6 digits.
  std::vector<ImportedCamera> expected = cameras;
  for (ImportedCamera& camera : expected) {
    camera.cam_from_rig = *camera.cam_from_rig * cameras[0].cam_from_rig->Inverse();
  }
  ExpectSame(expected, rig, 0.02);
}

TEST(ReadQtm, ReadsQualisysAndRecognisesTheia) {
  const std::vector<ImportedCamera> cameras = RingOfCameras(6, kDistortion);
  ASSERT_OK_AND_ASSIGN(const ImportedRig qtm, ReadQtm("rig.qca.txt", QtmText(cameras)));
  ExpectSame(cameras, qtm, 0.01);
  EXPECT_THAT(qtm.notes, IsEmpty());
  ASSERT_OK_AND_ASSIGN(const ImportedRig theia, ReadQtm("cal.txt", TheiaText(cameras)));
  ExpectSame(cameras, theia, 0.01);
  ASSERT_THAT(theia.notes, SizeIs(1));
  EXPECT_THAT(theia.notes[0], AllOf(HasSubstr("0 of 6"), HasSubstr("Theia"), HasSubstr("6 do")));
}

// The distortion of Vicon's own model, computed here, against the fitted lens.
TEST(ReadVicon, FitsTheLensAndReadsThePose) {
  const double k1 = 2.5e-8, k2 = 4e-15;
  const std::vector<ImportedCamera> cameras = RingOfCameras(5, std::vector<double>(5, 0.0));
  ASSERT_OK_AND_ASSIGN(const ImportedRig rig, ReadVicon("rig.xcp", ViconText(cameras, k1, k2)));
  ASSERT_EQ(rig.cameras.size(), cameras.size());
  ASSERT_THAT(rig.notes, SizeIs(1));
  EXPECT_THAT(rig.notes[0], HasSubstr("fitted"));
  for (size_t i = 0; i < cameras.size(); ++i) {
    EXPECT_EQ(rig.cameras[i].name, cameras[i].name);
    const Eigen::Vector2d centre(cameras[i].intrinsics.cx_px, cameras[i].intrinsics.cy_px);
    for (double u = 0; u < 1920; u += 160) {
      for (double v = 0; v < 1088; v += 136) {
        const Eigen::Vector2d from_centre = Eigen::Vector2d(u, v) - centre;
        const double r2 = from_centre.squaredNorm();
        const Eigen::Vector2d ray =
            from_centre * (1 + k1 * r2 + k2 * r2 * r2) / cameras[i].intrinsics.fx_px;
        const Eigen::Vector3d x = cameras[i].cam_from_rig->Inverse() * (4 * ray.homogeneous());
        Eigen::Vector2d seen(1e9, 1e9);
        Project(rig.cameras[i].intrinsics, *rig.cameras[i].cam_from_rig * x, &seen);
        EXPECT_LT((seen - Eigen::Vector2d(u, v)).norm(), 0.05);
      }
    }
  }
}

TEST(ReadVicon, RefusesALensThatOursCannotDescribe) {
  const auto cameras = RingOfCameras(3, std::vector<double>(5, 0.0));
  EXPECT_THAT(ReadVicon("rig.xcp", ViconText(cameras, -4e-7, 0)),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("rig.xcp, line 5"), HasSubstr("cannot describe"))));
}

struct BadText {
  const char* what;
  const char* from;  // replaced in a good text
  const char* to;
  const char* says;
};

TEST(ReadQtm, NamesFileAndLineOfEveryFault) {
  const std::string good = QtmText(RingOfCameras(3, kDistortion));
  const BadText faults[] = {
      {"no number", "skew=\"0\"", "skew=\"zero\"", "line 8: <intrinsic> skew is not"},
      {"missing", " r32=", " r42=", "line 5: <transform> has no r32"},
      {"skew", "skew=\"0\"", "skew=\"1\"", "has a skew"},
      {"not finite", "focallength=\"9\" sensorMinU=\"0\"", "sensorMinU=\"nan\"", "sensorMinU"},
      {"no lens", "<intrinsic", "<lens", "line 4: <camera> has no <intrinsic>"},
      {"cut off", "</calibration>", "", "is not XML"},
      {"one name twice", "serial=\"102\"", "serial=\"101\"", "two cameras 101"},
      {"no cameras", "<cameras>", "<cameras></cameras><cameras>", "has no cameras"}};
  for (const BadText& fault : faults) {
    SCOPED_TRACE(fault.what);
    const std::string text = absl::StrReplaceAll(good, {{fault.from, fault.to}});
    ASSERT_NE(text, good);
    EXPECT_THAT(FirstFault(ReadQtm("rig.qca.txt", text)),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         AllOf(HasSubstr("rig.qca.txt"), HasSubstr(fault.says))));
  }
}

TEST(ReadQtm, RefusesAMirroredRotation) {
  std::vector<ImportedCamera> cameras = RingOfCameras(3, kDistortion);
  std::string text = QtmText(cameras);
  for (const char* name : {"r11", "r12", "r13"}) {  // turns one row round
    text = absl::StrReplaceAll(text, {{std::string(name) + "=\"-", std::string(name) + "=\"#"}});
    text = absl::StrReplaceAll(text, {{std::string(name) + "=\"", std::string(name) + "=\"-"}});
    text = absl::StrReplaceAll(text, {{std::string(name) + "=\"-#", std::string(name) + "=\""}});
  }
  EXPECT_THAT(FirstFault(ReadQtm("rig.qca.txt", text)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("mirrored")));
}

std::string OpenCvText(const std::string& extrinsics) {
  return "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n"
         "   rows: 3\n   cols: 3\n   dt: d\n   data: [500., 0., 320., 0., 500., 240., 0., 0., 1.]\n"
         "distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n"
         "   data: [0., 0., 0., 0., 0.]\nextrinsics: !!opencv-matrix\n" +
         extrinsics;
}

// The one camera of a file.
absl::StatusOr<ImportedCamera> ReadOpenCvCamera(const std::string& path) {
  absl::StatusOr<ImportedRig> rig = ReadCalibrationFile(path);
  if (!rig.ok()) return rig.status();
  return rig->cameras.at(0);
}

TEST(ReadOpenCvCamera, ReadsPosesOfThreeAndOfFourRows) {
  const TemporaryDirectory directory;
  const auto path = directory.WriteFile(
      "left.yaml", OpenCvText("   rows: 3\n   cols: 4\n   dt: d\n"
                              "   data: [1., 0., 0., 1., 0., 1., 0., 2., 0., 0., 1., 3.]\n"));
  ASSERT_OK_AND_ASSIGN(const ImportedCamera camera, ReadOpenCvCamera(path.string()));
  EXPECT_EQ(camera.name, "left");
  EXPECT_EQ(camera.cam_from_rig->translation_m, Eigen::Vector3d(1, 2, 3));
}

TEST(ReadOpenCvCamera, RefusesPosesThatAreNone) {
  const TemporaryDirectory directory;
  const std::string four = "   rows: 4\n   cols: 4\n   dt: d\n   data: ";
  const std::pair<std::string, const char*> faults[] = {
      {four + "[1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 1., 2., 3., 1.]\n",
       "line 15: extrinsics has a last row"},
      {four + "[1., 0., 0., 1., 0., 1., 0., 2., 0., 0., -1., 3., 0., 0., 0., 1.]\n", "mirrored"},
      {four + "[2., 0., 0., 1., 0., 1., 0., 2., 0., 0., 1., 3., 0., 0., 0., 1.]\n", "no rotation"},
      {"   rows: 1\n   cols: 2\n   dt: d\n   data: [1., 0.]\n", "1 x 2"}};
  for (const auto& [extrinsics, says] : faults) {
    const auto path = directory.WriteFile("left.yaml", OpenCvText(extrinsics));
    EXPECT_THAT(ReadOpenCvCamera(path.string()),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         AllOf(HasSubstr("left.yaml"), HasSubstr(says))));
  }
}

TEST(ReadKalibr, NamesFileAndLineOfEveryFault) {
  const v1::Calibration calibration = CalibrationOfLens(TestLens::kBrown4, {"left", "right"});
  const std::string good =
      (*FindCalibrationExportFormat("kalibr"))->make(calibration).value()[0].content;
  const BadText faults[] = {
      {"another camera", "camera_model: pinhole", "camera_model: omni", "camera_model omni"},
      {"another lens", "distortion_model: radtan", "distortion_model: fov", "distortion_model fov"},
      {"missing", "resolution:", "size:", "line 3: cam0 has no resolution"},
      {"no number", "distortion_coeffs: [", "distortion_coeffs: [x, ", "line 9: cam0"},
      {"not a rotation", "T_cam_imu:\n  - [1.0", "T_cam_imu:\n  - [2.0", "line 4: cam0 T_cam_imu"},
      {"not YAML", "intrinsics: [", "intrinsics: [[", "rig.yaml, line"},
      {"no camera", "cam0:", "camera:", "cam0 is missing before cam1"}};
  for (const BadText& fault : faults) {
    SCOPED_TRACE(fault.what);
    const std::string text = absl::StrReplaceAll(good, {{fault.from, fault.to}});
    ASSERT_NE(text, good);
    EXPECT_THAT(FirstFault(ReadKalibr("rig.yaml", text)),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         AllOf(HasSubstr("rig.yaml"), HasSubstr(fault.says))));
  }
}

TEST(ReadCaliscope, NamesFileAndLineOfEveryFault) {
  const v1::Calibration calibration = CalibrationOfLens(TestLens::kBrown4, {"left", "right"});
  const std::string good =
      (*FindCalibrationExportFormat("caliscope"))->make(calibration).value()[0].content;
  const BadText faults[] = {
      {"missing", "size = ", "resolution = ", "line 2: camera cam_0 has no size"},
      {"no number", "distortions = [", "distortions = [\"x\", ",
       "line 9: camera cam_0 distortions"},
      {"too many", "distortions = [", "distortions = [0.0, ", "6 distortions"},
      {"too few", "translation = [", "translation = [0.0, ", "4 numbers, not 3"},
      {"not TOML", "size = [", "size = [[", "rig.toml, line"},
      {"control characters", "[cameras.0]", "[\x01]", "line 2: byte 0x01"},
      {"no name of a table", "[cameras.1]", "[;cameras.1]", "rig.toml, line 14"},
      {"a bracket of another kind", "matrix = [", "matrix = [}", "rig.toml, line"},
      {"letters beyond ASCII", "fisheye =", "\xd0\xb8 fisheye =", "rig.toml, line"},
      {"no cameras", "[cameras.", "[things.", "has no cameras"}};
  for (const BadText& fault : faults) {
    SCOPED_TRACE(fault.what);
    const std::string text = absl::StrReplaceAll(good, {{fault.from, fault.to}});
    ASSERT_NE(text, good);
    EXPECT_THAT(FirstFault(ReadCaliscope("rig.toml", text)),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         AllOf(HasSubstr("rig.toml"), HasSubstr(fault.says))));
  }
}

TEST(ReadCalibrationFile, RefusesWhatIsNoCalibration) {
  const TemporaryDirectory directory;
  EXPECT_THAT(ReadCalibrationFile((directory.path() / "none.xcp").string()),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("none.xcp")));
  EXPECT_THAT(ReadCalibrationFile(directory.path().string()),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("without OpenCV files")));
  const BadText files[] = {{"empty.xcp", "", " \n", "is empty"},
                           {"page.xml", "", "<html/>", "line 1: begins with <html>"},
                           {"table.csv", "", "a,b\n", "of no format"},
                           {"broken.yaml", "", "%YAML:1.0\n---\nimage_width: 3\n", "image_height"},
                           {"wide.toml", "", "\xff\xfe[", "UTF-16"}};
  for (const BadText& file : files) {
    const auto path = directory.WriteFile(file.what, file.to);
    EXPECT_THAT(ReadCalibrationFile(path.string()),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         AllOf(HasSubstr(file.what), HasSubstr(file.says))));
  }
}

TEST(ReadCalibrationFile, RefusesDeepNesting) {
  const TemporaryDirectory directory;
  const auto repeated = [](const std::string& text) {
    std::string all;
    for (int i = 0; i < 50'000; ++i) all += text;
    return all;
  };
  const BadText files[] = {{"header.toml", "", "", "line 1"},
                           {"lists.yaml", "", "", "line 2"},
                           {"tags.xml", "", "", "line 1"}};
  const std::string texts[] = {"[cam_0" + repeated(".a") + "]\n",
                               "cam0:\n  T: " + repeated("[\"]\","), repeated("<a>")};
  for (size_t i = 0; i < std::size(files); ++i) {
    EXPECT_THAT(ReadCalibrationFile(directory.WriteFile(files[i].what, texts[i]).string()),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         AllOf(HasSubstr(files[i].what), HasSubstr(files[i].says),
                               HasSubstr("nested more than 64"))));
  }
}

// An entity that unfolds to gigabytes, and one that names a file of this machine.
TEST(ReadCalibrationFile, UnfoldsNoEntities) {
  const TemporaryDirectory directory;
  std::string bomb = "<?xml version=\"1.0\"?><!DOCTYPE c [<!ENTITY a \"aaaaaaaaaa\">";
  for (char entity = 'b'; entity < 'm'; ++entity) {
    const std::string inner = std::string("&") + static_cast<char>(entity - 1) + ";";
    bomb += std::string("<!ENTITY ") + entity + " \"" + inner + inner + inner + inner + inner +
            inner + inner + inner + inner + inner + "\">";
  }
  bomb += "]><calibration><cameras><camera serial=\"&l;\"/></cameras></calibration>";
  EXPECT_THAT(ReadCalibrationFile(directory.WriteFile("bomb.xml", bomb).string()),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("bomb.xml")));
}

}  // namespace
}  // namespace rigcal::import_readers_test
