// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/thin_out.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace rigcal::server::thin_out_test {
namespace {

// Instants of tracks 0 and 1; every 50th has track 2, too.
std::vector<Instant> Instants(int count) {
  std::vector<Instant> instants;
  for (int i = 0; i < count; ++i) {
    Instant instant;
    instant.rig_time_ns = int64_t{i} * 10'000'000;
    instant.members = {{0, i}, {1, i}};
    if (i % 50 == 0) instant.members.push_back({2, i / 50});
    instants.push_back(instant);
  }
  return instants;
}

RigIndex ThreeCameras() {
  RigIndex index;
  index.cameras.resize(3);
  index.camera_of_track = {0, 1, 2};
  return index;
}

std::vector<int64_t> Times(const std::vector<Instant>& instants) {
  std::vector<int64_t> times;
  for (const Instant& instant : instants) times.push_back(instant.rig_time_ns);
  return times;
}

std::vector<int64_t> TimesLeft(std::vector<Instant> instants, size_t max_observations) {
  ThinOut(ThreeCameras(), max_observations, &instants);
  return Times(instants);
}

TEST(ThinOut, LeavesAboutAsManyObservationsSpreadOverTheRecording) {
  std::vector<Instant> instants = Instants(10'000);
  ThinOut(ThreeCameras(), 3000, &instants);
  size_t observations = 0;
  for (const Instant& instant : instants) observations += instant.members.size();
  EXPECT_GT(observations, 1800u);
  EXPECT_LT(observations, 3200u);
  // Of each tenth of the recording.
  for (int64_t tenth = 0; tenth < 10; ++tenth) {
    const auto count = std::ranges::count_if(
        Times(instants), [tenth](int64_t time_ns) { return time_ns / 10'000'000'000 == tenth; });
    EXPECT_GT(count, 80) << tenth;
  }
}

TEST(ThinOut, LeavesWhatThereIsLittleOf) {
  const std::vector<int64_t> left = TimesLeft(Instants(10'000), 3000);
  for (int i = 0; i < 10'000; i += 50) {
    EXPECT_TRUE(std::ranges::binary_search(left, int64_t{i} * 10'000'000)) << i;
  }
}

TEST(ThinOut, LeavesAllOfAFewAndWithoutALimit) {
  for (const size_t limit : {size_t{0}, size_t{1'000'000}}) {
    EXPECT_EQ(TimesLeft(Instants(1000), limit).size(), 1000u) << limit;
  }
  EXPECT_TRUE(TimesLeft({}, 10).empty());
}

// Whether an instant stays is no matter of where in the list it is.
TEST(ThinOut, AnInstantLessChangesNoOther) {
  std::vector<Instant> instants = Instants(10'000);
  std::vector<int64_t> left = TimesLeft(instants, 3000);
  const int64_t lost = instants[1].rig_time_ns;
  instants.erase(instants.begin() + 1);
  std::vector<int64_t> left_without = TimesLeft(instants, 3000);
  std::erase(left, lost);
  std::vector<int64_t> different;
  std::ranges::set_symmetric_difference(left, left_without, std::back_inserter(different));
  EXPECT_LE(different.size(), 1u);  // one fewer makes the share a little larger
}

// Cameras of half the rate have every second row of the fast one's instants.
TEST(ThinOut, ThinsEveryRateAlike) {
  std::vector<Instant> instants = Instants(10'000);
  std::erase_if(instants, [](const Instant& instant) {
    return instant.members.front().observation % 2 != 0 || instant.members.size() > 2;
  });
  const size_t before = instants.size();
  ThinOut(ThreeCameras(), before, &instants);  // two members each: a half stays
  EXPECT_GT(instants.size(), before / 4);
  EXPECT_LT(instants.size(), 3 * before / 4);
}

}  // namespace
}  // namespace rigcal::server::thin_out_test
