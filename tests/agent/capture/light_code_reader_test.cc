// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/light_code_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "common/light_code/light_code.h"

namespace rigcal::agent::light_code_reader_test {
namespace {

using ::testing::HasSubstr;

Detection At(double time_s, double wand_s, uint32_t clock_epoch = 0) {
  Detection detection;
  detection.observation.time_ns = std::llround(1e9 * time_s);
  detection.observation.clock_epoch = clock_epoch;
  detection.light_level = LightCode::Of(4).IsDimmed(wand_s) ? 0.3 : 0.5;
  return detection;
}

TEST(LightCodeReader, GivesClockSamplesOfTheWand) {
  LightCodeReader reader;
  for (int i = 0; i < 300; ++i) reader.Look("left", At(i / 30.0, 100 + i / 30.0));
  const std::vector<ClockSample> samples = reader.Take();
  ASSERT_FALSE(samples.empty());
  for (const ClockSample& sample : samples) {
    EXPECT_EQ(sample.light, 4u);
    EXPECT_TRUE(sample.IsOfWand());
    EXPECT_NEAR(1e-9 * static_cast<double>(sample.light_ns - sample.device_ns), 100, 1 / 30.0);
    EXPECT_EQ(sample.host_utc_ns, 0);
  }
  EXPECT_TRUE(reader.Take().empty());
  RefusalCounter refused;
  reader.AddRefused(&refused);
  EXPECT_TRUE(refused.empty());
}

TEST(LightCodeReader, CountsFramesOfACameraThatIsTooSlowAndSaysTheRate) {
  LightCodeReader reader;
  for (int i = 0; i < 300; ++i) reader.Look("left", At(i / 12.0, 100 + i / 12.0));
  EXPECT_TRUE(reader.Take().empty());
  RefusalCounter refused;
  reader.AddRefused(&refused);
  ASSERT_EQ(refused.List().size(), 1u);
  EXPECT_EQ(refused.List()[0].reason, RefusalReason::kLightCodeTooFast);
  EXPECT_THAT(refused.List()[0].example, HasSubstr("set 20 frames a second or more"));
}

// Rows of two epochs say nothing of each other.
TEST(LightCodeReader, AnotherClockEpochBeginsAnew) {
  LightCodeReader reader;
  for (int i = 0; i < 150; ++i) reader.Look("left", At(i / 30.0, 100 + i / 30.0));
  EXPECT_TRUE(reader.Take().empty());  // 5 s
  for (int i = 0; i < 150; ++i) reader.Look("left", At(6 + i / 30.0, 106 + i / 30.0, 1));
  EXPECT_TRUE(reader.Take().empty());
}

TEST(LightCodeReader, DetectionsWithoutALevelAreNothing) {
  LightCodeReader reader;
  Detection none;
  for (int i = 0; i < 100; ++i) reader.Look("left", none);
  EXPECT_TRUE(reader.Take().empty());
}

}  // namespace
}  // namespace rigcal::agent::light_code_reader_test
