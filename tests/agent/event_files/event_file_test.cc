// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/event_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "agent/event/evt3_writer.h"
#include "agent/event_files/hdf5_event_writer.h"
#include "tests/testing/blinking_wand.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::event_file_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class EventFileTest : public ::testing::Test {
 protected:
  std::string Write(const std::string& text, const std::string& name = "left.csv") {
    const std::string path = (directory_.path() / name).string();
    testing::WriteBytes(path, {text.begin(), text.end()});
    return path;
  }
  // All events of a CSV or HDF5 file.
  absl::StatusOr<std::vector<PlainEvent>> ReadAll(const std::string& path,
                                                  const EventFileOptions& options = {}) {
    auto file = OpenEventFile(path, options);
    if (!file.ok()) return file.status();
    header_ = (*file)->header();
    std::vector<PlainEvent> events;
    while (true) {
      EXPECT_EQ((*file)->byte_offset(), events.size() * sizeof(PlainEvent));
      const auto bytes = (*file)->Next(64);
      refused_ = (*file)->Refused();
      if (!bytes.ok()) return bytes.status();
      if (bytes->empty()) return events;
      places_.push_back((*file)->PlaceOf(events.size() * sizeof(PlainEvent)));
      const auto* const first = reinterpret_cast<const PlainEvent*>(bytes->data());
      events.insert(events.end(), first, first + bytes->size() / sizeof(PlainEvent));
    }
  }

  testing::TemporaryDirectory directory_;
  EventFileHeader header_;
  std::vector<std::string> places_;
  std::vector<Refusal> refused_;
};

PlainEvent On(int64_t time_us, uint16_t x, uint16_t y) {
  return {.time_us = time_us, .x = x, .y = y, .kind = PlainEvent::kOn};
}

// Headers of old files do not say in which order the halves of a word are; there was one order then.
TEST_F(EventFileTest, WordsOfEvt21AreInTheOrderOfTheirTimeOrAsAskedFor) {
  const auto swapped = [this](const std::string& endianness, Evt21Order order) {
    const std::string path = Write(
        absl::StrCat("% format EVT21", endianness, ";height=720;width=1280\n% end\n"), "a.raw");
    EventFileOptions options;
    options.evt21_order = order;
    const auto file = OpenEventFile(path, options);
    EXPECT_THAT(file, IsOk());
    return file.ok() && (*file)->header().halves_swapped;
  };
  EXPECT_TRUE(swapped("", Evt21Order::kAuto));
  EXPECT_FALSE(swapped("", Evt21Order::kLittle));
  EXPECT_TRUE(swapped(";endianness=legacy", Evt21Order::kAuto));
  EXPECT_FALSE(swapped(";endianness=little", Evt21Order::kAuto));
  EXPECT_TRUE(swapped(";endianness=little", Evt21Order::kLegacy));
}

TEST_F(EventFileTest, IsToldByWhatItIsAndNotByItsName) {
  const std::string raw = Evt3Header({640, 480}, "1");
  ASSERT_OK_AND_ASSIGN(auto file, OpenEventFile(Write(raw, "a.h5")));
  EXPECT_EQ(file->header().format_name, "EVT3");
  EXPECT_EQ(file->byte_offset(), raw.size());
  ASSERT_OK_AND_ASSIGN(file, OpenEventFile(Write("1,2,1,4\n", "b.raw")));
  EXPECT_EQ(file->header().format_name, "CSV");
  const std::string path = (directory_.path() / "c.csv").string();
  ASSERT_OK_AND_ASSIGN(auto writer, CreateHdf5EventWriter(path, {}, Hdf5EventLayout::kColumns));
  ASSERT_THAT(writer->Finish(), IsOk());
  ASSERT_OK_AND_ASSIGN(file, OpenEventFile(path));
  EXPECT_EQ(file->header().format_name, "HDF5");
}

TEST_F(EventFileTest, CsvWithAndWithoutAHeaderLine) {
  for (const char* const front :
       {"", "x,y,p,t\n", "# anything\n\nx,y,p,t\n", "\xEF\xBB\xBFx,y,p,t\r\n"}) {
    ASSERT_OK_AND_ASSIGN(const auto events,
                         ReadAll(Write(std::string(front) + "1,2,1,10\r\n3,4,1,20")));
    EXPECT_THAT(events, ElementsAre(On(10, 1, 2), On(20, 3, 4))) << front;
    EXPECT_EQ(header_.time_unit, TimeUnit::kMicroseconds);
    EXPECT_FALSE(header_.geometry);
  }
}

TEST_F(EventFileTest, CsvThatTellsItsGeometry) {
  for (const char* const front : {"%geometry:640,480\n", "# geometry 640x480\n", "640 480\n"}) {
    ASSERT_OK_AND_ASSIGN(const auto events, ReadAll(Write(std::string(front) + "1,2,1,10\n")));
    EXPECT_THAT(events, SizeIs(1));
    EXPECT_EQ(header_.geometry, (SensorGeometry{640, 480})) << front;
  }
}

TEST_F(EventFileTest, SecondsAreToldByTheirFractions) {
  // The first line has none.
  ASSERT_OK_AND_ASSIGN(auto events, ReadAll(Write("1,2,1,3\n3,4,1,3.000001\n")));
  EXPECT_THAT(events, ElementsAre(On(3'000'000, 1, 2), On(3'000'001, 3, 4)));
  EXPECT_EQ(header_.time_unit, TimeUnit::kSeconds);
  ASSERT_OK_AND_ASSIGN(events, ReadAll(Write("1,2,1,3.0\n3,4,1,4.0\n")));
  EXPECT_EQ(events[0].time_us, 3);
  ASSERT_OK_AND_ASSIGN(events, ReadAll(Write("x,y,p,t_s\n1,2,1,3\n")));
  EXPECT_EQ(events[0].time_us, 3'000'000);
  ASSERT_OK_AND_ASSIGN(events,
                       ReadAll(Write("1,2,1,3000\n"), {.time_unit = TimeUnit::kNanoseconds}));
  EXPECT_EQ(events[0].time_us, 3);
  EXPECT_THAT(ReadAll(Write("1,2,1,1700000000000000000\n")),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("time=ns")));
}

// As e2vid takes them.
TEST_F(EventFileTest, AnotherOrderOfColumns) {
  ASSERT_OK_AND_ASSIGN(const auto events,
                       ReadAll(Write("240 180\n0.25 7 8 1\n"), {.columns = "txyp"}));
  EXPECT_THAT(events, ElementsAre(On(250'000, 7, 8)));
  EXPECT_EQ(header_.geometry, (SensorGeometry{240, 180}));
}

TEST_F(EventFileTest, BadLinesAreLeftOutAndCounted) {
  const std::string path = Write("x,y,p,t\n1,2,1,10\n1,2\n\n5,6,7,8\n3,4,1,20\n" +
                                 std::string(5000, '9') + "\n3,4,1,30\n");
  ASSERT_OK_AND_ASSIGN(const auto events, ReadAll(path));
  EXPECT_THAT(events, ElementsAre(On(10, 1, 2), On(20, 3, 4), On(30, 3, 4)));
  ASSERT_THAT(refused_, SizeIs(1));
  EXPECT_EQ(refused_[0].reason, RefusalReason::kEventCsvBadLine);
  EXPECT_EQ(refused_[0].count, 3u);
  EXPECT_THAT(refused_[0].example, AllOf(HasSubstr("left.csv:3: "), HasSubstr("2 fields")));
  EXPECT_THAT(places_, ElementsAre("line 2"));
}

TEST_F(EventFileTest, ADamagedByteMakesOneBadLine) {
  std::string text;
  for (int i = 0; i < 100; ++i) absl::StrAppend(&text, "1,2,1,", 10 + i, "\n");
  text[450] = '\0';
  ASSERT_OK_AND_ASSIGN(const auto events, ReadAll(Write(text)));
  EXPECT_THAT(events, SizeIs(99));
  ASSERT_THAT(refused_, SizeIs(1));
  EXPECT_EQ(refused_[0].count, 1u);
}

TEST_F(EventFileTest, GivesUpOnAFileThatTurnsIntoSomethingElse) {
  std::string text;
  for (int i = 0; i < 100; ++i) absl::StrAppend(&text, "1,2,1,", i, "\n");
  for (int i = 0; i < 5000; ++i) text += "what?\n";
  EXPECT_THAT(ReadAll(Write(text)),
              StatusIs(absl::StatusCode::kDataLoss,
                       AllOf(HasSubstr("left.csv:1101: "), HasSubstr("1001 of 1101"))));
}

TEST_F(EventFileTest, SaysWhatAFileIsNot) {
  EXPECT_THAT(ReadAll(Write("")), StatusIs(absl::StatusCode::kInvalidArgument,
                                           AllOf(HasSubstr("left.csv"), HasSubstr("empty"))));
  EXPECT_THAT(ReadAll(Write("hello\nworld\n")),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("left.csv:1: "), HasSubstr("HDF5"), HasSubstr("EVT3"))));
  EXPECT_THAT(ReadAll(Write("1 2 3\n4 5 6\n")),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("left.csv:1: "), HasSubstr("3 fields"))));
  EXPECT_THAT(ReadAll(Write(std::string("\x01\x00\x02", 3))),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("byte 0"), HasSubstr("known: RAW"))));
  EXPECT_THAT(ReadAll(Write("\x89HDF\r\n\x1a\n and no more")),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("HDF5 cannot open it")));
  EXPECT_THAT(ReadAll((directory_.path() / "none").string()),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("none")));
  EXPECT_THAT(ReadAll(directory_.path().string()),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("no file")));
}

TEST_F(EventFileTest, AHeaderLineWithoutEvents) {
  ASSERT_OK_AND_ASSIGN(const auto events, ReadAll(Write("x,y,p,t\n")));
  EXPECT_THAT(events, IsEmpty());
}

}  // namespace
}  // namespace rigcal::agent::event_file_test
