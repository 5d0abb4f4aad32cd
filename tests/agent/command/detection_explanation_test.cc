// SPDX-License-Identifier: Apache-2.0
#include "agent/command/detection_explanation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "common/target/target.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::detection_explanation_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

WandTrial Refused(double x_px, std::string_view why) {
  WandTrial trial;
  for (const double offset_px : {0.0, 50.0, 150.0}) {
    trial.wand.centres.emplace_back().centre_px = {x_px + offset_px, 300};
  }
  trial.refusal = why;
  return trial;
}

class Explanation : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_OK_AND_ASSIGN(target_, ParseTarget("wand:0,0.13,0.39;diameter=0.04"));
    explanation_.detection.outcome = DetectionOutcome::kNoWand;
  }
  std::string Text() const { return FormatExplanation("picture 1", explanation_, target_, 0.6); }
  std::string Why() const {
    return nlohmann::json::parse(ExplanationJson("picture 1", explanation_, target_))["why"];
  }

  Target target_;
  WandExplanation explanation_;
};

TEST_F(Explanation, NamesTheBlobsThatWereRefusedOnceEach) {
  explanation_.detection.blob_count = 4;
  explanation_.trials = {Refused(10, "too far"), Refused(10, "too far"), Refused(20, "too far"),
                         Refused(30, "no sphere")};
  EXPECT_THAT(Text(), AllOf(HasSubstr("3 sets of blobs refused before: too far\n"
                                      "    at (10.0, 300.0) (60.0, 300.0) (160.0, 300.0) px\n"
                                      "    at (20.0, 300.0)"),
                            HasSubstr("1 set of blobs refused before: no sphere\n    at (30.0")));
  const auto json = nlohmann::json::parse(ExplanationJson("picture 1", explanation_, target_));
  EXPECT_EQ(json["refused"][0]["markers_px"][0][0][0], 30);
}

TEST_F(Explanation, SaysWhatIsThereInstead) {
  explanation_.detection.blob_count = 3;
  explanation_.detection.other_middle_share = 0.5;
  EXPECT_THAT(Text(),
              HasSubstr("the middle one is at 0.50 of their distance, the target says 0.33"));
  explanation_.detection.other_middle_share = 0;
  EXPECT_THAT(Why(), HasSubstr("no 3 of the blobs are on a line"));
  explanation_.detection.blob_count = 2;
  EXPECT_THAT(Why(), HasSubstr("3 spheres: one is not seen"));
  explanation_.detection.blob_count = 0;
  EXPECT_THAT(Why(), HasSubstr("tune"));
  EXPECT_THAT(Text(), Not(HasSubstr("scored")));
  explanation_.detection.outcome = DetectionOutcome::kWand;
  EXPECT_EQ(Why(), "");
}

}  // namespace
}  // namespace rigcal::agent::detection_explanation_test
