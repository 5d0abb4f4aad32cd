// SPDX-License-Identifier: Apache-2.0
#include "client/net/unknown_id.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rigcal::client::unknown_id_test {
namespace {

using ::testing::AllOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;

const KnownIds kKnown = {.sessions = {"board", "wave_2", "wave_1"}, .calibrations = {"c-2", "c-1"}};

std::string Describe(const char* message, const KnownIds& known = kKnown) {
  const UnknownId unknown = ParseUnknownId(message);
  return unknown.kind.empty() ? "" : DescribeUnknownId(unknown, known);
}

TEST(UnknownId, OtherMessagesAreNoUnknownIds) {
  for (const char* message : {"", "no", "no session ", "no session a b", "no calibration of it",
                              "session a is damaged", "no agent has a camera 'left'"}) {
    EXPECT_EQ(ParseUnknownId(message).kind, "") << message;
  }
}

TEST(UnknownId, WhatThereIsIsListedNewestFirst) {
  EXPECT_EQ(Describe("no session xyzzy"),
            "no session xyzzy; there is board, wave_2, wave_1 (newest first)");
  KnownIds many;
  for (int i = 0; i < 20; ++i) many.sessions.push_back("s-" + std::to_string(100 + i));
  EXPECT_THAT(Describe("no session xyzzy", many), HasSubstr("s-107 and 12 more"));
  EXPECT_THAT(Describe("no session a", {}), HasSubstr("rigcal session create"));
  EXPECT_THAT(Describe("no calibration a", {}), HasSubstr("rigcal calibrate"));
}

TEST(UnknownId, AnIdOfTheOtherKindNamesItsCommand) {
  EXPECT_THAT(Describe("no calibration wave_1"),
              AllOf(HasSubstr("wave_1 is a session"), HasSubstr("rigcal session get wave_1")));
  EXPECT_THAT(Describe("no session c-1"),
              AllOf(HasSubstr("c-1 is a calibration"), HasSubstr("rigcal calibration get c-1")));
}

TEST(UnknownId, WhatWasProbablyMeantIsNamed) {
  EXPECT_THAT(Describe("no session wave"), EndsWith("the beginning of wave_2, wave_1"));
  EXPECT_THAT(Describe("no session baord"), EndsWith("did you mean board?"));
  EXPECT_THAT(Describe("no session newest"), EndsWith("the newest one is board"));
  EXPECT_THAT(Describe("no calibration latest"), EndsWith("the newest one is c-2"));
  EXPECT_THAT(Describe("no session waev_1"),
              AllOf(StartsWith("no session waev_1; did you mean wave_1?"), EndsWith("is board")));
}

}  // namespace
}  // namespace rigcal::client::unknown_id_test
