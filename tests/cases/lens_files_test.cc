// SPDX-License-Identifier: Apache-2.0
// Lens files as OpenCV, ROS and kalibr write them, through `rigcal calibration import`, which reads
// them as agents and `rigcal local` do.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "common/import/intrinsics_file.h"
#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::lens_files_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const std::vector<double> kBrown = {-0.11, 0.06, 0.0003, -0.0002, 0.01};
const std::vector<double> kFour = {-0.02, 0.01, -0.006, 0.001};

std::vector<double> WithTail(std::vector<double> values, size_t count) {
  values.resize(count, 0.0);
  return values;
}

// As cv::FileStorage writes it in the format of this ending.
std::string OpenCvText(const std::string& ending, const std::vector<double>& distortion,
                       const std::string& model = "", int fisheye = -1) {
  cv::FileStorage storage(ending, cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
  storage << "image_width" << 1280 << "image_height" << 1024;
  const cv::Mat1d matrix = (cv::Mat1d(3, 3) << 1000, 0, 639.5, 0, 1001, 511.5, 0, 0, 1);
  storage << "camera_matrix" << cv::Mat(matrix);
  if (!model.empty()) storage << "distortion_model" << model;
  if (fisheye >= 0) storage << "fisheye_model" << fisheye;
  storage << "distortion_coefficients" << cv::Mat(cv::Mat(distortion, true).t());
  return storage.releaseAndGetString();
}

std::string RosText(const std::string& model, int cols, const std::string& values) {
  return "image_width: 1280\nimage_height: 1024\ncamera_name: narrow_stereo\ncamera_matrix:\n"
         "  rows: 3\n  cols: 3\n  data: [1000, 0, 639.5, 0, 1001, 511.5, 0, 0, 1]\n"
         "distortion_model: " +
         model + "\ndistortion_coefficients:\n  rows: 1\n  cols: " + std::to_string(cols) +
         "\n  data: [" + values + "]\n";
}

std::string KalibrText(const std::string& pose) {
  return "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [-0.02, 0.01, -0.006, 0.001]\n"
         "  distortion_model: equidistant\n  intrinsics: [1000, 1001, 639.5, 511.5]\n"
         "  resolution: [1280, 1024]\n  rostopic: /left/image_raw\n" +
         pose;
}

struct LensCase {
  std::string file;
  std::string text;
  DistortionModel model;
  std::vector<double> distortion;
};

class LensFile : public ::testing::Test {
 protected:
  CommandResult Import(const std::string& file, const std::string& text) {
    const auto path = folder_.WriteFile(file, text);
    return RunCommand({"rigcal", "calibration", "import", path.string(), "--output",
                       (folder_.path() / "out").string()});
  }
  const TemporaryDirectory folder_;
};

TEST_F(LensFile, IsReadInEveryFormAndExactly) {
  const auto brown = DistortionModel::kBrownConrady;
  const auto fisheye = DistortionModel::kFisheye;
  const std::vector<LensCase> cases = {
      {"a.yaml", OpenCvText(".yml", kBrown), brown, kBrown},
      {"b.yml", OpenCvText(".yml", kBrown), brown, kBrown},
      {"c.xml", OpenCvText(".xml", kBrown), brown, kBrown},
      {"d.json", OpenCvText(".json", kBrown), brown, kBrown},
      {"e.XML", OpenCvText(".xml", kFour, "", 1), fisheye, kFour},
      {"f.YAML", "\xef\xbb\xbf" + OpenCvText(".yml", kBrown), brown, kBrown},
      {"g.yaml", "\xef\xbb\xbf" + RosText("plumb_bob", 5, "-0.11, 0.06, 0.0003, -0.0002, 0.01"),
       brown, kBrown},
      {"h.yaml", OpenCvText(".yml", kFour, "", 1), fisheye, kFour},
      {"i.yaml", OpenCvText(".yml", kFour, "", 0), brown, WithTail(kFour, 5)},
      {"j.yaml", OpenCvText(".yml", kFour, "fisheye"), fisheye, kFour},
      {"k.yaml", RosText("kannala_brandt", 4, "-0.02, 0.01, -0.006, 0.001"), fisheye, kFour},
      {"l.yaml", RosText("Equidistant", 4, "-0.02, 0.01, -0.006, 0.001"), fisheye, kFour},
      {"m.yaml", OpenCvText(".yml", WithTail(kBrown, 12)), brown, kBrown},
      {"n.yaml", OpenCvText(".yml", WithTail(kBrown, 14)), brown, kBrown},
      {"o.yaml", OpenCvText(".yml", WithTail(kBrown, 8), "plumb_bob"), brown, kBrown},
      {"p.yaml",
       OpenCvText(".yml", WithTail({1, 2, 3, 4, 5, 6, 7, 8}, 14)),
       DistortionModel::kRational,
       {1, 2, 3, 4, 5, 6, 7, 8}},
      {"q.yaml",
       RosText("rational_polynomial", 5, "1, 2, 3, 4, 5, 6, 7, 8"),
       DistortionModel::kRational,
       {1, 2, 3, 4, 5, 6, 7, 8}},
      {"r.yaml", KalibrText(""), fisheye, kFour},
      {"s.yaml", "%YAML:1.0\n---\n" + KalibrText(""), fisheye, kFour}};
  for (const LensCase& lens : cases) {
    SCOPED_TRACE(lens.file);
    const auto path = folder_.WriteFile(lens.file, lens.text).string();
    ASSERT_OK_AND_ASSIGN(const IntrinsicsFile file, ReadIntrinsicsFile(path));
    EXPECT_EQ(file.image_size_px, (ImageSize{1280, 1024}));
    EXPECT_EQ(file.intrinsics, (Intrinsics{lens.model, 1000, 1001, 639.5, 511.5, lens.distortion}));
  }
}

// A lens without pose becomes a lens without pose, which agents read.
TEST_F(LensFile, IsImportedWithoutAPose) {
  const CommandResult result =
      Import("left.yaml", RosText("plumb_bob", 5, "-0.11, 0.06, 0.0003, -0.0002, 0.01"));
  EXPECT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(result.error, HasSubstr("lenses alone"));
  ASSERT_OK_AND_ASSIGN(const IntrinsicsFile file,
                       ReadIntrinsicsFile((folder_.path() / "out/left.yaml").string()));
  EXPECT_EQ(file.intrinsics.distortion, kBrown);
}

TEST_F(LensFile, IsRefusedForWhatOursCannotSay) {
  std::vector<double> prism = WithTail(kBrown, 14);
  prism[8] = 0.001;
  std::vector<double> tilted = WithTail(kBrown, 14);
  tilted[13] = -0.02;
  for (const auto& distortion : {prism, tilted}) {
    const CommandResult result = Import("left.yaml", OpenCvText(".yml", distortion));
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.error, AllOf(HasSubstr("left.yaml, line"),
                                    HasSubstr("thin prism or tilted sensor, not supported")));
  }
  EXPECT_THAT(Import("left.yaml", OpenCvText(".yml", kBrown, "", 1)).error,
              HasSubstr("equidistant has 4"));
  EXPECT_THAT(Import("left.yaml", OpenCvText(".yml", kFour, "plumb_bob", 1)).error,
              HasSubstr("fisheye_model is 1, but distortion_model is plumb_bob"));
}

TEST_F(LensFile, NamesTheKeysThatItHasBesideThoseExpected) {
  const CommandResult result = Import("left.yaml", "K: [1, 2, 3]\ndist: [0, 0, 0, 0]\nwidth: 5\n");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.error,
              AllOf(HasSubstr("K, dist, width"), HasSubstr("image_width"),
                    HasSubstr("camera_matrix"), HasSubstr("distortion_coefficients")));
}

TEST_F(LensFile, OfSeveralCamerasIsThatOfTheCamera) {
  std::string text = KalibrText("");
  std::string second = KalibrText("");
  second.replace(0, 5, "cam1:");
  second.replace(second.find("/left/"), 6, "/right/");
  second.replace(second.find("1000"), 4, "1100");
  const std::string path = folder_.WriteFile("chain.yaml", text + second).string();
  ASSERT_OK_AND_ASSIGN(const IntrinsicsFile right, ReadIntrinsicsFile(path, "right"));
  EXPECT_EQ(right.intrinsics.fx_px, 1100);
  ASSERT_OK_AND_ASSIGN(const IntrinsicsFile by_key, ReadIntrinsicsFile(path, "cam1"));
  EXPECT_EQ(by_key.intrinsics.fx_px, 1100);
  EXPECT_THAT(ReadIntrinsicsFile(path, "top"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("left, right")));
}

TEST_F(LensFile, OfKalibrSaysThatAPoseIsIgnored) {
  const CommandResult result =
      Import("left.yaml", KalibrText("  T_imu_cam:\n  - [1, 0, 0, 0]\n  - [0, 1, 0, 0]\n"
                                     "  - [0, 0, 1, 0]\n  - [0, 0, 0, 1]\n"));
  EXPECT_THAT(result.error, HasSubstr("T_imu_cam is ignored"));
}

TEST_F(LensFile, IsFoundBesideARecordingByAnyOfItsNames) {
  for (const char* name :
       {"left.yaml", "left.yml", "left.XML", "left.json", "left.camera_info.yaml"}) {
    const TemporaryDirectory folder;
    const std::string path = folder.WriteFile(name, "").string();
    EXPECT_EQ(LensFileBeside((folder.path() / "left.csv").string()), path);
  }
}

}  // namespace
}  // namespace rigcal::testing::lens_files_test
