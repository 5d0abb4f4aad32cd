// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_frequencies.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/target/target.h"

namespace rigcal::agent::blink_frequencies_test {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;

BlinkFrequencies Of(const char* target) { return BlinkFrequenciesOf(*ParseTarget(target), 500); }

TEST(BlinkFrequencies, OneForAllAndTheDefault) {
  for (const char* target : {"wand:0,0.2,0.4", "wand:0,0.2,0.4;hz=500", "point"}) {
    const BlinkFrequencies frequencies = Of(target);
    EXPECT_THAT(frequencies.hz, ElementsAre(500.0)) << target;
    EXPECT_THAT(frequencies.of_marker, ::testing::Each(0)) << target;
    EXPECT_EQ(frequencies.of_marker.size(), target[0] == 'p' ? 1u : 3u);
  }
}

TEST(BlinkFrequencies, OnePerMarkerAscending) {
  const BlinkFrequencies frequencies = Of("wand:0,0.2,0.4;hz=620,400,500");
  EXPECT_THAT(frequencies.hz, ElementsAre(400.0, 500.0, 620.0));
  EXPECT_THAT(frequencies.of_marker, ElementsAre(2, 0, 1));
}

TEST(BlinkFrequencies, NearlyEqualOnesAreOne) {
  const BlinkFrequencies frequencies = Of("wand:0,0.2,0.4,0.5;hz=499,620,505,502");
  EXPECT_THAT(frequencies.hz, ElementsAre(DoubleNear(502, 1e-9), 620.0));
  EXPECT_THAT(frequencies.of_marker, ElementsAre(0, 1, 0, 0));
}

}  // namespace
}  // namespace rigcal::agent::blink_frequencies_test
