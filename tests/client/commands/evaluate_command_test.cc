// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/client/command_runner.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::client::evaluate_command_test {
namespace {

using ::rigcal::testing::CommandOutcome;
using ::rigcal::testing::Rigcal;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;

// A helix; half a metre further along x and 0.05 s later.
std::string Helix(double shift_m, double delay_s) {
  std::ostringstream text;
  text.precision(12);
  text << "time_s,x_m,y_m,z_m\n";
  for (int i = 0; i < 500; ++i) {
    const double t = 0.01 * i;
    text << t + delay_s << "," << std::cos(3 * t) + shift_m << "," << std::sin(3 * t) << ","
         << 0.1 * t * t << "\n";
  }
  return text.str();
}

TEST(EvaluateCommand, PrintsTheErrorAndDrawsIt) {
  const TemporaryDirectory directory;
  const std::string estimate = directory.WriteFile("points.csv", Helix(0.5, 0)).string();
  const std::string truth = directory.WriteFile("truth.csv", Helix(0, 0.05)).string();
  const std::string plot = (directory.path() / "errors.svg").string();
  const CommandOutcome table =
      Rigcal({"evaluate", estimate, "--ground-truth", truth, "--plot", plot});
  EXPECT_EQ(table.exit_code, 0) << table.err;
  EXPECT_THAT(table.out, AllOf(HasSubstr("time offset 50.000 ms"), HasSubstr("RMSE 0.000 mm")));
  EXPECT_TRUE(std::filesystem::exists(plot));
  const auto json = nlohmann::json::parse(
      Rigcal({"evaluate", estimate, "--ground-truth", truth, "--keep-time", "-o", "json"}).out);
  EXPECT_EQ(json.at("time_offset_s"), 0);
  EXPECT_GT(json.at("total_rmse_m").get<double>(), 0.001);
}

TEST(EvaluateCommand, NamesTheFileThatIsMissing) {
  const CommandOutcome outcome = Rigcal({"evaluate", "none.csv", "--ground-truth", "truth.csv"});
  EXPECT_NE(outcome.exit_code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("none.csv"));
}

}  // namespace
}  // namespace rigcal::client::evaluate_command_test
