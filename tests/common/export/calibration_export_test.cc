// SPDX-License-Identifier: Apache-2.0
#include "common/export/calibration_export.h"

#include <gmock/gmock.h>
#include <google/protobuf/util/json_util.h>
#include <google/protobuf/util/message_differencer.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "tests/client/sample_messages.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::common_calibration_export_test {
namespace {

using ::rigcal::testing::FullCalibration;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::StartsWith;

const CalibrationExportFormat& Format(const std::string& name) {
  return **FindCalibrationExportFormat(name);
}

TEST(CalibrationExportFormats, HaveNamesOfTheirOwn) {
  std::set<std::string> names;
  for (const CalibrationExportFormat& format : CalibrationExportFormats()) {
    EXPECT_TRUE(names.insert(format.name).second) << format.name;
    EXPECT_EQ(FindCalibrationExportFormat(format.name).value(), &format);
  }
  EXPECT_THAT(
      FindCalibrationExportFormat("nothing"),
      StatusIs(absl::StatusCode::kInvalidArgument, AllOf(HasSubstr("opencv"), HasSubstr("json"))));
}

TEST(CalibrationExportFormats, RefuseACalibrationWithoutResult) {
  v1::Calibration failed = FullCalibration("cal-7");
  failed.set_state(v1::Calibration::STATE_FAILED);
  failed.set_error("no overlap");
  for (const CalibrationExportFormat& format : CalibrationExportFormats()) {
    EXPECT_THAT(format.make(failed),
                StatusIs(absl::StatusCode::kFailedPrecondition,
                         AllOf(HasSubstr("cal-7"), HasSubstr("failed"), HasSubstr("no overlap"))))
        << format.name;
  }
}

TEST(CalibrationExportFormats, OpenCvNeedsAScale) {
  v1::Calibration unscaled = FullCalibration();
  unscaled.set_scale_known(false);
  EXPECT_THAT(Format("opencv").make(unscaled),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("scale")));
}

TEST(MakeDownload, PacksSeveralFiles) {
  ASSERT_OK_AND_ASSIGN(const auto files, Format("opencv").make(FullCalibration("c-000007")));
  EXPECT_THAT(files, ElementsAre(Field(&ExportFile::name, "left.yaml"),
                                 Field(&ExportFile::name, "right.yaml")));
  ASSERT_OK_AND_ASSIGN(const ExportDownload download,
                       MakeDownload(Format("opencv"), FullCalibration("c-000007")));
  EXPECT_EQ(download.file_name, "c-000007-opencv.zip");
  EXPECT_EQ(download.content_type, "application/zip");
  EXPECT_THAT(download.content, StartsWith("PK"));
}

TEST(MakeDownload, LeavesOneFileAsItIs) {
  ASSERT_OK_AND_ASSIGN(const ExportDownload download,
                       MakeDownload(Format("json"), FullCalibration("c-000007")));
  EXPECT_EQ(download.file_name, "c-000007-json.json");
  EXPECT_EQ(download.content_type, "application/json");
  v1::Calibration read;
  ASSERT_TRUE(google::protobuf::util::JsonStringToMessage(download.content, &read).ok());
  EXPECT_TRUE(
      google::protobuf::util::MessageDifferencer::Equals(read, FullCalibration("c-000007")));
}

}  // namespace
}  // namespace rigcal::common_calibration_export_test
