// SPDX-License-Identifier: Apache-2.0
#include "client/results/calibration_export.h"

#include <gmock/gmock.h>
#include <google/protobuf/util/json_util.h>
#include <google/protobuf/util/message_differencer.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <sstream>
#include <string>

#include "common/import/intrinsics_file.h"
#include "common/wire/camera_wire.h"
#include "tests/client/sample_messages.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::client::calibration_export_test {
namespace {

using ::rigcal::testing::FullCalibration;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string ReadFile(const std::filesystem::path& path) {
  std::ifstream stream(path);
  return {std::istreambuf_iterator<char>(stream), {}};
}

// The numbers of a matrix in an OpenCV FileStorage file.
std::vector<double> Matrix(const std::string& text, const std::string& name) {
  const size_t at = text.find("data: [", text.find("\n" + name + ":"));
  const size_t end = text.find(']', at);
  std::string numbers = text.substr(at + 7, end - at - 7);
  std::replace(numbers.begin(), numbers.end(), ',', ' ');
  std::istringstream stream(numbers);
  return {std::istream_iterator<double>(stream), {}};
}

absl::StatusOr<std::vector<std::filesystem::path>> WriteOpenCv(
    const v1::Calibration& calibration, const std::filesystem::path& directory) {
  return WriteExport(**FindCalibrationExportFormat("opencv"), calibration, directory);
}

TEST(WriteExport, RoundTripsIntrinsicsPoseAndError) {
  const TemporaryDirectory directory;
  const v1::Calibration calibration = FullCalibration();
  // A folder that is not there yet, with a space.
  const auto folder = directory.path() / "my rig" / "result";
  ASSERT_OK_AND_ASSIGN(const auto files, WriteOpenCv(calibration, folder));
  EXPECT_THAT(files, ElementsAre(folder / "left.yaml", folder / "right.yaml"));

  const v1::CalibratedCamera& right = calibration.cameras(1);
  ASSERT_OK_AND_ASSIGN(const IntrinsicsFile read,
                       ReadIntrinsicsFile((folder / "right.yaml").string()));
  EXPECT_EQ(read.image_size_px, (ImageSize{1280, 1024}));
  EXPECT_EQ(read.intrinsics, *wire::FromProto(right.intrinsics()));

  const std::string text = ReadFile(folder / "right.yaml");
  const Eigen::Matrix4d expected = wire::FromProto(right.cam_from_rig())->Matrix();
  const std::vector<double> extrinsics = Matrix(text, "extrinsics");
  ASSERT_EQ(extrinsics.size(), 16u);
  for (int i = 0; i < 16; ++i) {
    EXPECT_NEAR(extrinsics[static_cast<size_t>(i)], expected(i / 4, i % 4), 1e-12) << i;
  }
  const std::string field = "\nreprojection_error: ";
  ASSERT_THAT(text, HasSubstr(field));
  EXPECT_EQ(std::stod(text.substr(text.find(field) + field.size())), 0.25) << "of the markers used";
}

TEST(WriteExport, ReplacesWhatIsThere) {
  const TemporaryDirectory directory;
  directory.WriteFile("left.yaml", "something older and longer than nothing");
  ASSERT_THAT(WriteOpenCv(FullCalibration(), directory.path()), IsOk());
  EXPECT_THAT(ReadIntrinsicsFile((directory.path() / "left.yaml").string()), IsOk());
}

TEST(WriteExport, RefusesACalibrationWithoutResultOrScale) {
  const TemporaryDirectory directory;
  v1::Calibration failed = FullCalibration("cal-7");
  failed.set_state(v1::Calibration::STATE_FAILED);
  failed.set_error("no overlap");
  EXPECT_THAT(WriteOpenCv(failed, directory.path()),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("cal-7"), HasSubstr("failed"), HasSubstr("no overlap"))));
  v1::Calibration unscaled = FullCalibration();
  unscaled.set_scale_known(false);
  EXPECT_THAT(WriteOpenCv(unscaled, directory.path()),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("scale")));
  EXPECT_TRUE(std::filesystem::is_empty(directory.path()));
}

TEST(WriteExport, NeverWritesOutsideItsFolder) {
  const TemporaryDirectory directory;
  v1::Calibration evil = FullCalibration();
  evil.mutable_cameras(0)->set_camera("../escaped");
  EXPECT_THAT(WriteOpenCv(evil, directory.path() / "inside"),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("../escaped")));
  EXPECT_FALSE(std::filesystem::exists(directory.path() / "escaped.yaml"));
}

TEST(WriteExport, NamesAFolderThatCannotBeMade) {
  const TemporaryDirectory directory;
  const auto file = directory.WriteFile("taken", "");
  EXPECT_THAT(WriteOpenCv(FullCalibration(), file),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr(file.string())));
  EXPECT_THAT(WriteOpenCv(FullCalibration(), file / "below"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("below")));
}

TEST(WriteJsonExport, HoldsTheWholeCalibration) {
  const TemporaryDirectory directory;
  ASSERT_OK_AND_ASSIGN(const auto files,
                       WriteJsonExport(FullCalibration(), {}, directory.path(), nullptr));
  EXPECT_THAT(files, ElementsAre(directory.path() / "calibration.json"));
  v1::Calibration read;
  ASSERT_TRUE(google::protobuf::util::JsonStringToMessage(ReadFile(files[0]), &read).ok());
  EXPECT_TRUE(google::protobuf::util::MessageDifferencer::Equals(read, FullCalibration()));
}

}  // namespace
}  // namespace rigcal::client::calibration_export_test
