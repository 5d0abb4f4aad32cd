// SPDX-License-Identifier: Apache-2.0
#include "agent/offer/camera_scan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/testing/status_matchers.h"

namespace rigcal::agent::camera_scan_test {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;

TEST(ReadSimulatedOffer, ReadsACountAndOptions) {
  ScanOptions options;
  ASSERT_THAT(ReadSimulatedOffer("3", &options), IsOk());
  EXPECT_EQ(options.simulated_count, 3);
  EXPECT_EQ(options.simulated_options, "");
  ASSERT_THAT(ReadSimulatedOffer("2;speed=max;duration=20", &options), IsOk());
  EXPECT_EQ(options.simulated_count, 2);
  EXPECT_EQ(options.simulated_options, "speed=max;duration=20");
}

TEST(ReadSimulatedOffer, RefusesBadCountsAndOptions) {
  ScanOptions options;
  for (const char* text : {"", "0", "65", "-1", "x", "3,speed=max"}) {
    EXPECT_THAT(ReadSimulatedOffer(text, &options),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("1 to 64")))
        << text;
  }
  EXPECT_THAT(ReadSimulatedOffer("3;sped=max", &options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("sped")));
}

TEST(ScanCameras, OffersSimulatedAndAravisFakeCameras) {
  ASSERT_OK_AND_ASSIGN(const auto seen, ScanCameras({.devices = false,
                                                     .fake = true,
                                                     .simulated_count = 2,
                                                     .simulated_options = "speed=max"}));
  const auto find = [&](const std::string& device) {
    return std::ranges::find(seen, device, [](const auto& one) { return one.offer.device; });
  };
  const auto fake = find("Fake_1");
  ASSERT_NE(fake, seen.end());
  EXPECT_EQ(fake->source, "aravis:Fake_1");
  EXPECT_EQ(fake->offer.vendor, "Aravis");
  EXPECT_EQ(fake->offer.use, OfferedCamera::Use::kFree);
  EXPECT_TRUE(fake->IsSource("aravis:Fake_1"));
  EXPECT_FALSE(fake->IsSource("aravis:Fake_2"));
  EXPECT_FALSE(fake->IsSource("sim:Fake_1"));
  const auto simulated = find("sim-1");
  ASSERT_NE(simulated, seen.end());
  EXPECT_EQ(simulated->source, "sim:camera=1;cameras=2;speed=max");
  EXPECT_EQ(find("sim-2"), seen.end());
}

TEST(SeenCamera, IsNamedByAnyOfItsNames) {
  const SeenCamera camera{.offer = {.device = "50423", .kind = "metavision"},
                          .source = "metavision:serial=Prophesee:hal:50423",
                          .names = {"Prophesee:hal:50423", "50423", ""}};
  EXPECT_TRUE(camera.IsSource("metavision:50423"));
  EXPECT_TRUE(camera.IsSource("metavision:serial=50423"));
  EXPECT_FALSE(camera.IsSource("metavision:"));
  EXPECT_FALSE(camera.IsSource("aravis:50423"));
}

}  // namespace
}  // namespace rigcal::agent::camera_scan_test
