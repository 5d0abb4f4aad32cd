// SPDX-License-Identifier: Apache-2.0
#include "agent/command/marker_csv.h"

#include <string>

#include "agent/event_files/event_file_writer.h"
#include "common/target/csv_line.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::marker_csv_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;

Observation SomeObservation() {
  Observation observation;
  observation.time_ns = 1699999999123456789;
  observation.markers.resize(3);
  observation.markers[0].visible = true;
  observation.markers[0].centre_px = {12.34567, 1023.99999};
  observation.markers[2].visible = true;
  observation.markers[2].centre_px = {0, -0.25};
  return observation;
}

TEST(MarkerCsvLine, IsWhatTheCsvSourceReads) {
  const std::string line = MarkerCsvLine(SomeObservation());
  EXPECT_EQ(line, "1699999999123456789;12.34567;1023.99999;-1;-1;0.00000;-0.25000\n");
  Observation read;
  ASSERT_FALSE(ParseCsvLine(line, 3, 0.5, &read).has_value());
  EXPECT_EQ(read.time_ns, 1699999999123456789);
  EXPECT_TRUE(read.markers[0].visible);
  EXPECT_FALSE(read.markers[1].visible);
  EXPECT_NEAR(read.markers[0].centre_px.x(), 12.34567, 1e-9);
  EXPECT_NEAR(read.markers[2].centre_px.y(), -0.25, 1e-9);
}

TEST(MarkerCsvLine, SaysWhereItCannotBeWritten) {
  ASSERT_OK_AND_ASSIGN(OutputFile full, OutputFile::Create("/dev/full"));
  absl::Status status;
  for (int i = 0; i < 1000 && status.ok(); ++i) {
    status = full.Write(MarkerCsvLine(SomeObservation()));
  }
  EXPECT_THAT(status, StatusIs(absl::StatusCode::kDataLoss, ::testing::HasSubstr("/dev/full")));
}

}  // namespace
}  // namespace rigcal::agent::marker_csv_test
