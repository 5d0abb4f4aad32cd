// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/raw_header.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/testing/status_matchers.h"

namespace rigcal::agent::raw_header_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

absl::StatusOr<EventFileHeader> Parse(const std::string& text) {
  return ParseRawHeader({reinterpret_cast<const uint8_t*>(text.data()), text.size()});
}

TEST(RawHeader, ReadsFormatAndGeometry) {
  const std::string text = "% format EVT3;height=720;width=1280\n% end\n%%%%";
  ASSERT_OK_AND_ASSIGN(const EventFileHeader header, Parse(text));
  EXPECT_EQ(header.format, EventFormat::kEvt3);
  EXPECT_EQ(header.geometry, (SensorGeometry{1280, 720}));
  EXPECT_EQ(header.byte_count, text.size() - 4);
}

TEST(RawHeader, ReadsTheEndiannessOfEvt21) {
  ASSERT_OK_AND_ASSIGN(const EventFileHeader swapped,
                       Parse("% format EVT21;endianness=legacy;height=720;width=1280\n% end\n"));
  EXPECT_EQ(swapped.format, EventFormat::kEvt21);
  EXPECT_TRUE(swapped.halves_swapped);
  ASSERT_OK_AND_ASSIGN(const EventFileHeader little,
                       Parse("% format EVT21;endianness=little;height=720;width=1280\n% end\n"));
  EXPECT_FALSE(little.halves_swapped);
}

TEST(RawHeader, OldCamerasTellTheirGeometryByTheirSystem) {
  ASSERT_OK_AND_ASSIGN(const EventFileHeader large, Parse("% evt 3.0\n% system_ID 49\n% end\n"));
  EXPECT_EQ(large.geometry, (SensorGeometry{1280, 720}));
  ASSERT_OK_AND_ASSIGN(const EventFileHeader small, Parse("% evt 2.0\n% system_ID 41\n% end\n"));
  EXPECT_EQ(small.geometry, (SensorGeometry{640, 480}));
  ASSERT_OK_AND_ASSIGN(const EventFileHeader unknown,
                       Parse("% evt 2.0\n% system_ID 4711\n% end\n"));
  EXPECT_FALSE(unknown.geometry);
  ASSERT_OK_AND_ASSIGN(
      const EventFileHeader stated,
      Parse("% evt 3.0\n% system_ID 49\n% format EVT3;height=320;width=640\n% end\n"));
  EXPECT_EQ(stated.geometry, (SensorGeometry{640, 320}));
}

TEST(RawHeader, OldHeadersHaveNoEnd) {
  const std::string text = std::string("% Date 2020\n% evt 2.0\n") + '\x01' + "\x02\x03\x04\n";
  ASSERT_OK_AND_ASSIGN(const EventFileHeader header, Parse(text));
  EXPECT_EQ(header.byte_count, text.size() - 5);
  EXPECT_FALSE(header.geometry);
}

TEST(RawHeader, EventsMayBeginLikeALine) {
  const std::string text = std::string("% evt 2.0\n") + "%\x01\x02\x80\n\n";
  ASSERT_OK_AND_ASSIGN(const EventFileHeader header, Parse(text));
  EXPECT_EQ(header.byte_count, 10u);
}

TEST(RawHeader, RefusesWhatIsNoRawFile) {
  for (const std::string text : {"", "\x89PNG\r\n", "x,y,p,t\n1,2,0,5\n"}) {
    EXPECT_THAT(Parse(text), StatusIs(absl::StatusCode::kInvalidArgument,
                                      AllOf(HasSubstr("byte 0"), HasSubstr("not a RAW file"),
                                            HasSubstr("EVT21"))));
  }
}

TEST(RawHeader, NamesTheByteOfAFault) {
  EXPECT_THAT(Parse("% evt 4.0\n"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("byte 0"), HasSubstr("\"4.0\""), HasSubstr("EVT21"))));
  EXPECT_THAT(Parse("% evt 3.0\n% geometry 640x\n"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("byte 10")));
  EXPECT_THAT(Parse("% evt 3.0\n% geometry 640x999999\n"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("1 to 2048")));
  EXPECT_THAT(Parse("% format EVT3;height=720;width=1280\n% geometry 640x480\n"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("contradicts 1280x720")));
  EXPECT_THAT(Parse("% evt 2.0\n% format EVT3;height=720;width=1280\n"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("contradicts")));
  EXPECT_THAT(Parse("% date 2023\n% end\n"), StatusIs(absl::StatusCode::kInvalidArgument,
                                                      HasSubstr("how the events are encoded")));
}

}  // namespace
}  // namespace rigcal::agent::raw_header_test
