// SPDX-License-Identifier: Apache-2.0
#include "common/camera/camera_export.h"

#include <filesystem>
#include <fstream>
#include <limits>
#include <opencv2/core.hpp>
#include <sstream>

#include "common/import/intrinsics_file.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::camera_export_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;

CameraExport Example(DistortionModel model) {
  CameraExport camera;
  camera.camera = "frame_1";
  camera.image_size_px = {1280, 1024};
  camera.intrinsics = {model,   1255.3825070256302, 1253.6248140197960,
                       1.0 / 3, 506.8443738025127,  {}};
  for (int i = 0; i < CoefficientCount(model); ++i) {
    camera.intrinsics.distortion.push_back((i % 2 == 0 ? -0.1 : 1e-7) / (i + 3));
  }
  camera.cam_from_rig =
      RigidTransform(Eigen::Quaterniond(0.5, -0.5, 0.5, 0.5), {1.25, -0.1, 1.0 / 7});
  camera.reprojection_error_px = 0.1 + 0.2;
  return camera;
}

std::string ReadAll(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

TEST(WriteCameraExport, IsReadBackWithEveryDigit) {
  const TemporaryDirectory folder;
  for (const DistortionModel model :
       {DistortionModel::kBrownConrady, DistortionModel::kRational, DistortionModel::kFisheye}) {
    const CameraExport camera = Example(model);
    const std::string path = folder.path() / "camera.yaml";
    ASSERT_THAT(WriteCameraExport(path, camera), IsOk());
    ASSERT_OK_AND_ASSIGN(const IntrinsicsFile file, ReadIntrinsicsFile(path));
    EXPECT_EQ(file.image_size_px, camera.image_size_px);
    EXPECT_EQ(file.intrinsics, camera.intrinsics);
  }
}

TEST(WriteCameraExport, IsWhatOpenCvReads) {
  const TemporaryDirectory folder;
  const CameraExport camera = Example(DistortionModel::kBrownConrady);
  const std::string path = folder.path() / "camera.yaml";
  ASSERT_THAT(WriteCameraExport(path, camera), IsOk());
  cv::FileStorage storage(path, cv::FileStorage::READ);
  cv::Mat matrix, distortion, extrinsics;
  storage["camera_matrix"] >> matrix;
  storage["distortion_coefficients"] >> distortion;
  storage["extrinsics"] >> extrinsics;
  ASSERT_EQ(matrix.size(), cv::Size(3, 3));
  EXPECT_EQ(matrix.at<double>(0, 0), camera.intrinsics.fx_px);
  EXPECT_EQ(matrix.at<double>(1, 2), camera.intrinsics.cy_px);
  ASSERT_EQ(distortion.size(), cv::Size(5, 1));
  ASSERT_EQ(extrinsics.size(), cv::Size(4, 4));
  ASSERT_EQ(extrinsics.type(), CV_64F);
  const Eigen::Matrix4d expected = camera.cam_from_rig->Matrix();
  for (int row = 0; row < 4; ++row) {
    for (int col = 0; col < 4; ++col) {
      EXPECT_EQ(extrinsics.at<double>(row, col), expected(row, col)) << row << " " << col;
    }
  }
  EXPECT_EQ(static_cast<std::string>(storage["camera_name"]), "frame_1");
  EXPECT_EQ(static_cast<std::string>(storage["distortion_model"]), "plumb_bob");
  EXPECT_EQ(static_cast<int>(storage["image_width"]), 1280);
  EXPECT_EQ(static_cast<int>(storage["image_height"]), 1024);
  EXPECT_EQ(static_cast<double>(storage["reprojection_error"]), 0.1 + 0.2);
  EXPECT_THAT(ReadAll(path), HasSubstr("extrinsics: !!opencv-matrix"));
}

TEST(WriteCameraExport, WritesNoDistortionAsZeros) {
  const TemporaryDirectory folder;
  CameraExport camera = Example(DistortionModel::kBrownConrady);
  camera.intrinsics.distortion.clear();
  const std::string path = folder.path() / "camera.yaml";
  ASSERT_THAT(WriteCameraExport(path, camera), IsOk());
  ASSERT_OK_AND_ASSIGN(const IntrinsicsFile file, ReadIntrinsicsFile(path));
  EXPECT_EQ(file.intrinsics.distortion, std::vector<double>(5, 0.0));
}

TEST(WriteCameraExport, ReplacesAFileAndLeavesNothingElseBehind) {
  const TemporaryDirectory folder;
  const std::filesystem::path path = folder.WriteFile("camera.yaml", std::string(100000, 'x'));
  ASSERT_THAT(WriteCameraExport(path, Example(DistortionModel::kRational)), IsOk());
  EXPECT_THAT(ReadIntrinsicsFile(path), IsOk());
  int files = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder.path())) {
    ++files;
  }
  EXPECT_EQ(files, 1);
}

TEST(WriteCameraExport, LeavesTheOldFileWhenTheValuesAreBad) {
  const TemporaryDirectory folder;
  const std::filesystem::path path = folder.WriteFile("camera.yaml", "old");
  CameraExport camera = Example(DistortionModel::kBrownConrady);
  camera.cam_from_rig->translation_m.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(WriteCameraExport(path, camera),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera.yaml"), HasSubstr("frame_1"))));
  camera = Example(DistortionModel::kBrownConrady);
  camera.intrinsics.fx_px = 0;
  EXPECT_THAT(WriteCameraExport(path, camera),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("fx_px")));
  EXPECT_EQ(ReadAll(path), "old");
}

TEST(WriteCameraExport, NamesTheFileThatCannotBeWritten) {
  const TemporaryDirectory folder;
  const CameraExport camera = Example(DistortionModel::kBrownConrady);
  const absl::Status missing = WriteCameraExport(folder.path() / "no" / "camera.yaml", camera);
  EXPECT_EQ(missing.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(missing.message()), HasSubstr("no/camera.yaml"));
  std::filesystem::create_directory(folder.path() / "taken.yaml");
  EXPECT_FALSE(WriteCameraExport(folder.path() / "taken.yaml", camera).ok());
  EXPECT_TRUE(std::filesystem::is_directory(folder.path() / "taken.yaml"));
}

}  // namespace
}  // namespace rigcal::camera_export_test
