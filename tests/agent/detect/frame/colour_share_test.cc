// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/colour_share.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rigcal::agent::colour_share_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(CrowdedText, SaysNothingOfALittle) { EXPECT_EQ(CrowdedText(0.02, 0.02), ""); }

TEST(ColourShareText, SaysWhatPassesWithoutAdvice) {
  EXPECT_EQ(ColourShareText(0.02, 0.02), "");
  EXPECT_EQ(ColourShareText(0.38, 0.3),
            "38 % of the picture passes the colour test, 30 % are white: windows or lamps");
  EXPECT_EQ(ColourShareText(0.38, 0.1),
            "38 % of the picture passes the colour test: surfaces of the wand's colour");
}

TEST(CrowdedText, NamesSharesAndTheExposureToSet) {
  EXPECT_THAT(
      CrowdedText(0.38, 0.3, {.exposure_s = 0.008, .blink_s = 0.002}),
      AllOf(HasSubstr("38 % of the picture passes the colour test, 30 % are white"),
            HasSubstr("what stands still is ignored"), HasSubstr("shorten the exposure from 8 to 2 ms")));
  EXPECT_THAT(CrowdedText(0.38, 0, {.exposure_s = 0.008}),
              AllOf(HasSubstr("surfaces of the wand's colour"), Not(HasSubstr("exposure"))));
}

TEST(TooManyText, HasNumbersWhereLittlePasses) {
  EXPECT_THAT(TooManyText(0.021, 0),
              AllOf(HasSubstr("cut short"), HasSubstr("2.1 % of the picture"),
                    HasSubstr("rigcal-agent tune")));
  EXPECT_THAT(TooManyText(0.021, 0.02, {.exposure_s = 0.008, .blink_s = 0.002}),
              AllOf(HasSubstr("2.1 % of the picture"), HasSubstr("shorten the exposure from 8")));
  EXPECT_EQ(TooManyText(0.38, 0.3), CrowdedText(0.38, 0.3));
}

TEST(ShorterExposureText, KeepsTheSpheresBrightEnough) {
  EXPECT_EQ(ShorterExposureText({.exposure_s = 0.01, .blink_s = 0.001, .marker_grey = 200}),
            "shorten the exposure from 10 to 5 ms, at which the spheres keep 100 of 200 grey "
            "levels");
  EXPECT_THAT(ShorterExposureText({.exposure_s = 0.01, .blink_s = 0.001, .marker_grey = 255}),
              HasSubstr("at least 255"));
}

TEST(ShorterExposureText, StaysAWholeNumberOfBlinks) {
  EXPECT_THAT(ShorterExposureText({.exposure_s = 0.01, .blink_s = 0.002, .marker_grey = 200}),
              HasSubstr("to 4 ms"));
  EXPECT_THAT(ShorterExposureText({.exposure_s = 0.002, .blink_s = 0.002, .marker_grey = 250}),
              AllOf(HasSubstr("as short as the wand allows"), HasSubstr("aperture")));
  EXPECT_THAT(ShorterExposureText({.exposure_s = 0.01, .marker_grey = 110}),
              HasSubstr("as short as the wand allows"));
}

TEST(ShorterExposureText, HelpsWithoutKnowingTheExposure) {
  EXPECT_EQ(ShorterExposureText({}), "shorten the exposure");
  EXPECT_THAT(ShorterExposureText({.blink_s = 0.002}),
              HasSubstr("not below one blink of the wand, 2 ms"));
}

}  // namespace
}  // namespace rigcal::agent::colour_share_test
