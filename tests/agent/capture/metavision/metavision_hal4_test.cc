// SPDX-License-Identifier: Apache-2.0
// Beside it the tests of all metavision_*_test.cc run on the SDK's interface of 4.x.
#include <gtest/gtest.h>

#include "metavision/hal/facilities/i_events_stream.h"

namespace {

template <typename Stream>
constexpr bool kHandsOutPointers = requires(Stream& stream, long& size) {
  stream.get_latest_raw_data(size);
};

TEST(MetavisionHal4, HandsOutPointers) {
  EXPECT_TRUE(kHandsOutPointers<Metavision::I_EventsStream>);
}

}  // namespace
