// SPDX-License-Identifier: Apache-2.0
#include "client/commands/lens_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "tests/client/command_runner.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::client::lens_command_test {
namespace {

using ::rigcal::testing::CommandOutcome;
using ::rigcal::testing::Rigcal;
using ::testing::HasSubstr;

std::string Yaml(double focal_px, double cx_px, double k1, int width = 640) {
  return "%YAML:1.0\n---\nimage_width: " + std::to_string(width) +
         "\nimage_height: 480\n"
         "camera_matrix: !!opencv-matrix\n  rows: 3\n  cols: 3\n  dt: d\n  data: [" +
         std::to_string(focal_px) + ", 0, " + std::to_string(cx_px) + ", 0, " +
         std::to_string(focal_px) +
         ", 240, 0, 0, 1]\n"
         "distortion_coefficients: !!opencv-matrix\n  rows: 1\n  cols: 5\n  dt: d\n  data: [" +
         std::to_string(k1) + ", 0, 0, 0, 0]\n";
}

TEST(LensCommand, SaysHowFarTwoLensesAreApart) {
  const rigcal::testing::TemporaryDirectory folder;
  const auto a = folder.WriteFile("a.yaml", Yaml(500, 320, -0.1));
  const auto same = folder.WriteFile("same.yaml", Yaml(500, 320, -0.1));
  const auto shifted = folder.WriteFile("shifted.yaml", Yaml(500, 321, -0.1));
  const auto other = folder.WriteFile("other.yaml", Yaml(500, 320, -0.12));
  const auto median = [&](const std::string& b) {
    const CommandOutcome outcome = Rigcal({"lens", "diff", a, b, "-o", "json"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return nlohmann::json::parse(outcome.out)["median_px"].get<double>();
  };
  EXPECT_LT(median(same), 1e-6);
  // A principal point that is a pixel off is a turn of 0.11 degrees and little else.
  EXPECT_LT(median(shifted), 0.3);
  EXPECT_GT(median(other), 0.1);
  const CommandOutcome text = Rigcal({"lens", "diff", a, shifted});
  EXPECT_THAT(text.out, HasSubstr("after a turn of 0.1"));
}

TEST(LensCommand, RefusesWhatCannotBeCompared) {
  const rigcal::testing::TemporaryDirectory folder;
  const auto a = folder.WriteFile("a.yaml", Yaml(500, 320, -0.1));
  const auto large = folder.WriteFile("large.yaml", Yaml(500, 320, -0.1, 1280));
  const CommandOutcome sizes = Rigcal({"lens", "diff", a, large});
  EXPECT_EQ(sizes.exit_code, 1);
  EXPECT_THAT(sizes.err, HasSubstr("1280 x 480"));
  const CommandOutcome none = Rigcal({"lens", "diff", a, (folder.path() / "no.yaml").string()});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_THAT(none.err, HasSubstr("no.yaml: no such calibration file"));
}

}  // namespace
}  // namespace rigcal::client::lens_command_test
