// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/learning/kept_detector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::kept_detector_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;

CameraDescription Camera(uint32_t width) {
  CameraDescription camera;
  camera.camera = "left";
  camera.image_size_px = {width, 48};
  return camera;
}

class KeptDetector : public ::testing::Test {
 protected:
  KeptDetector() {
    PixelMask mask(64, 48);
    mask.Set(5, 7);
    detector_.SetMask(std::move(mask));
    detector_.SetColour(ColourRange{.hue_min_deg = 340.5, .hue_max_deg = 12, .value_min = 90});
  }

  const TemporaryDirectory directory_;
  const std::filesystem::path folder_ = directory_.path() / "detectors";
  DetectorControl detector_{Camera(64), {}, {}};
};

TEST_F(KeptDetector, ComesBackAsItWas) {
  ASSERT_THAT(KeepDetector(folder_, detector_), IsOk());
  DetectorControl again(Camera(64), {}, {});
  ASSERT_THAT(RestoreDetector(folder_, &again), IsOk());
  EXPECT_EQ(again.learnt_colour(), detector_.learnt_colour());
  EXPECT_EQ(again.learnt_mask(), detector_.learnt_mask());
}

TEST_F(KeptDetector, WhatIsForgottenDoesNotComeBack) {
  ASSERT_THAT(KeepDetector(folder_, detector_), IsOk());
  detector_.SetMask({});
  detector_.SetColour({});
  ASSERT_THAT(KeepDetector(folder_, detector_), IsOk());
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
  DetectorControl again(Camera(64), {.value_min = 33}, {});
  ASSERT_THAT(RestoreDetector(folder_, &again), IsOk());
  EXPECT_EQ(again.colour().value_min, 33);
  EXPECT_EQ(again.ignored().width(), 0);
}

TEST_F(KeptDetector, NothingIsKeptWithoutAFolder) {
  EXPECT_THAT(KeepDetector("", detector_), IsOk());
  EXPECT_THAT(RestoreDetector("", &detector_), IsOk());
}

TEST_F(KeptDetector, SaysWhatCannotBeUsedAndUsesTheRest) {
  ASSERT_THAT(KeepDetector(folder_, detector_), IsOk());
  for (const char* content : {"{", "[]", R"({"hue_min": 1})",
                              R"({"hue_min": 1, "hue_max": 900, "saturation_min": 0,
                                  "value_min": 1, "washed_out_min": 1})"}) {
    std::ofstream(folder_ / "left.json") << content;
    DetectorControl again(Camera(64), {}, {});
    EXPECT_THAT(RestoreDetector(folder_, &again),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         AllOf(HasSubstr("left.json"), HasSubstr("learn it again"))));
    EXPECT_FALSE(again.learnt_colour().has_value()) << content;
    EXPECT_TRUE(again.ignored().Get(5, 7));
  }
  DetectorControl wider(Camera(128), {}, {});
  EXPECT_THAT(RestoreDetector(folder_, &wider),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("left.png"), HasSubstr("64x48"))));
  EXPECT_EQ(wider.ignored().width(), 0);
}

TEST_F(KeptDetector, SaysWhereItCannotBeKept) {
  std::ofstream(folder_) << "a file";
  EXPECT_THAT(KeepDetector(folder_, detector_),
              StatusIs(absl::StatusCode::kInternal, HasSubstr(folder_.string())));
}

}  // namespace
}  // namespace rigcal::agent::kept_detector_test
