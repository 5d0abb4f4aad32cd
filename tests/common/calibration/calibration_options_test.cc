// SPDX-License-Identifier: Apache-2.0
#include "common/calibration/calibration_options.h"

#include <limits>

#include "tests/testing/status_matchers.h"

namespace rigcal::calibration_options_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(CalibrationOptions, AcceptsTheDefaultsAndOrdinaryValues) {
  CalibrationOptions options;
  EXPECT_THAT(options.Validate(), IsOk());
  options.reference_camera = "frame_0";
  options.intrinsics = Estimate::kAuto;
  options.sigma_px = 0.5;
  options.association_tolerance_s = 0.01;
  EXPECT_THAT(options.Validate(), IsOk());
}

TEST(CalibrationOptions, RefusesValuesOutOfRangeAndNotFinite) {
  for (const double bad : {-1e-9, 101.0, std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity()}) {
    CalibrationOptions options;
    options.sigma_px = bad;
    EXPECT_THAT(options.Validate(),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("sigma_px")));
    options = {};
    options.association_tolerance_s = bad;
    EXPECT_THAT(options.Validate(),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("association_tolerance_s")));
    options = {};
    options.accept_m = bad == 101 ? 1001 : bad;
    EXPECT_THAT(options.Validate(),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("accept_m")));
  }
}

TEST(CalibrationOptions, ADistanceIsBetweenTwoCamerasAndPositive) {
  CalibrationOptions options;
  options.known_distance = KnownDistance{"left", "right", 1.25, 0};
  EXPECT_THAT(options.Validate(), IsOk());
  EXPECT_EQ(options.known_distance->SigmaM(), KnownDistance::kDefaultSigmaM);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  for (const KnownDistance& wrong :
       {KnownDistance{"left", "left", 1, 0}, KnownDistance{"", "right", 1, 0},
        KnownDistance{"left", "ri ght/", 1, 0}, KnownDistance{"left", "right", 0, 0},
        KnownDistance{"left", "right", -1, 0}, KnownDistance{"left", "right", nan, 0},
        KnownDistance{"left", "right", infinity, 0}, KnownDistance{"left", "right", 1, -0.1},
        KnownDistance{"left", "right", 1, nan}, KnownDistance{"left", "right", 1, 1}}) {
    options.known_distance = wrong;
    EXPECT_THAT(options.Validate(),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("known_distance")));
  }
}

TEST(CalibrationOptions, ListsEveryFault) {
  CalibrationOptions options;
  options.reference_camera = "no such/name";
  options.intrinsics = static_cast<Estimate>(9);
  options.time_offsets = static_cast<Estimate>(10);
  options.marker_positions = static_cast<Estimate>(11);
  options.sigma_px = -1;
  EXPECT_THAT(options.Validate(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("reference_camera"), HasSubstr("intrinsics"),
                             HasSubstr("time_offsets"), HasSubstr("marker_positions"),
                             HasSubstr("sigma_px"))));
}

}  // namespace
}  // namespace rigcal::calibration_options_test
