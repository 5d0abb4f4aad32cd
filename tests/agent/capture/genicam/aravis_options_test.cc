// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/aravis_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "tests/testing/status_matchers.h"

namespace rigcal::agent::aravis_options_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

AravisSourceOptions GoodOptions() {
  AravisSourceOptions options;
  options.camera = "left";
  options.device = "127.0.0.1";
  return options;
}

TEST(AravisSourceOptions, DefaultsOfANamedDeviceAreValid) {
  EXPECT_THAT(GoodOptions().Validate(), IsOk());
}

TEST(AravisSourceOptions, NamesEachFault) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::pair<std::function<void(AravisSourceOptions*)>, std::string>> faults{
      {[](auto* o) { o->camera.clear(); }, "name"},
      {[](auto* o) { o->device.clear(); }, "device"},
      {[](auto* o) { o->exposure_s = 0; }, "exposure"},
      {[&](auto* o) { o->exposure_s = nan; }, "exposure"},
      {[](auto* o) { o->exposure_s = 11; }, "exposure"},
      {[&](auto* o) { o->gain_db = nan; }, "gain"},
      {[](auto* o) { o->frame_rate_hz = 0; }, "frame_rate"},
      {[&](auto* o) { o->frame_rate_hz = nan; }, "frame_rate"},
      {[](auto* o) { o->frame_rate_hz = 1e6; }, "frame_rate"},
      {[](auto* o) { o->trigger.clear(); }, "trigger"},
      {[](auto* o) { o->trigger = "software"; }, "software"},
      {[](auto* o) { o->buffer_count = 2; }, "buffers"},
      {[](auto* o) { o->packet_size = 100; }, "packet_size"},
      {[](auto* o) { o->packet_size = 70'000; }, "packet_size"},
      {[](auto* o) { o->socket_buffer_bytes = 10; }, "socket_buffer"},
      {[&](auto* o) { o->latency_s = nan; }, "latency"},
      {[](auto* o) {
         o->exposure_s = 0.03;
         o->frame_rate_hz = 50;
       },
       "does not fit"}};
  for (const auto& [spoil, word] : faults) {
    AravisSourceOptions options = GoodOptions();
    spoil(&options);
    EXPECT_THAT(options.Validate(), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(word)));
  }
}

TEST(AravisSourceOptions, ListsAllFaultsAtOnce) {
  AravisSourceOptions options = GoodOptions();
  options.exposure_s = -1;
  options.packet_size = 1;
  EXPECT_THAT(options.Validate(), StatusIs(absl::StatusCode::kInvalidArgument,
                                           AllOf(HasSubstr("camera left"), HasSubstr("exposure"),
                                                 HasSubstr("packet_size"))));
}

}  // namespace
}  // namespace rigcal::agent::aravis_options_test
