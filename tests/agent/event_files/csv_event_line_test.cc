// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/csv_event_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <string>

#include "tests/testing/status_matchers.h"

namespace rigcal::agent::csv_event_line_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;
using ::testing::Optional;

PlainEvent Read(std::string_view line, TimeUnit unit = TimeUnit::kMicroseconds,
                const CsvEventColumns& columns = {}) {
  PlainEvent event;
  const auto fault = ParseCsvEventLine(line, columns, unit, &event);
  EXPECT_FALSE(fault) << line << ": " << *fault;
  return event;
}

TEST(CsvEventLine, SeparatorsAndBlanks) {
  const PlainEvent expected{.time_us = 99, .x = 3, .y = 4, .kind = PlainEvent::kOn};
  for (const char* const line :
       {"3,4,1,99", "3;4;1;99", "3 4 1 99", "3\t4\t1\t99", " 3 , 4 ,1, 99 ", "3.0,4.000,1.0,99.0",
        "+3,4,+1,99", "3,4,True,99"}) {
    EXPECT_EQ(Read(line), expected) << line;
  }
}

TEST(CsvEventLine, TimesAreExact) {
  EXPECT_EQ(Read("1,1,1,1234567890123456789").time_us, 1234567890123456789);
  EXPECT_EQ(Read("1,1,1,1000000000.000001", TimeUnit::kSeconds).time_us, 1000000000000001);
  EXPECT_EQ(Read("1,1,1,0.0000005", TimeUnit::kSeconds).time_us, 1);
  EXPECT_EQ(Read("1,1,1,0.00000049999", TimeUnit::kSeconds).time_us, 0);
  EXPECT_EQ(Read("1,1,1,-1.5", TimeUnit::kSeconds).time_us, -1500000);
  EXPECT_EQ(Read("1,1,1,1e-3", TimeUnit::kSeconds).time_us, 1000);
  EXPECT_EQ(Read("1,1,1,.25", TimeUnit::kSeconds).time_us, 250000);
  EXPECT_EQ(Read("1,1,1,7", TimeUnit::kSeconds).time_us, 7000000);
  EXPECT_EQ(Read("1,1,1,1999", TimeUnit::kNanoseconds).time_us, 1);
  EXPECT_EQ(Read("1,1,1,-1", TimeUnit::kNanoseconds).time_us, -1);
  EXPECT_EQ(Read("1,1,1,12.6").time_us, 13);
}

TEST(CsvEventLine, Polarities) {
  for (const char* const on : {"1", "true", "TRUE", "1.0"}) {
    EXPECT_EQ(Read(std::string("1,1,") + on + ",1").kind, PlainEvent::kOn) << on;
  }
  for (const char* const off : {"0", "-1", "false", "-1.0"}) {
    EXPECT_EQ(Read(std::string("1,1,") + off + ",1").kind, PlainEvent::kOff) << off;
  }
}

TEST(CsvEventLine, PixelsOfNoSensorAreForTheDecoderToCount) {
  EXPECT_EQ(Read("-1,70000,1,1").x, 65535);
  EXPECT_EQ(Read("-1,70000,1,1").y, 65535);
}

TEST(CsvEventLine, SaysWhatIsWrong) {
  struct Case {
    const char* line;
    const char* what;
  };
  for (const auto& [line, what] :
       {Case{"1,2,3", "3 fields instead of 4"}, Case{"1,2,1,4,5", "5 fields"},
        Case{"x,2,1,4", "x is \"x\""}, Case{"1,2.5,1,4", "y is \"2.5\""},
        Case{"1,2,2,4", "p is \"2\""}, Case{"1,2,nan,4", "p is"}, Case{"1,2,1,now", "t is \"now\""},
        Case{"1,2,1,nan", "t is"}, Case{"1,2,1,inf", "t is"},
        Case{"1,2,1,99999999999999999999", "t is"}, Case{"1,2,1,\x01\xff", "\\x01\\xff"},
        Case{"", "0 fields"}}) {
    PlainEvent event;
    EXPECT_THAT(ParseCsvEventLine(line, {}, TimeUnit::kMicroseconds, &event),
                Optional(HasSubstr(what)))
        << line;
  }
  PlainEvent event;
  EXPECT_THAT(ParseCsvEventLine("1,2,1,9999999999999.5", {}, TimeUnit::kSeconds, &event),
              Optional(HasSubstr("seconds")));
}

TEST(CsvEventLine, Headers) {
  EXPECT_TRUE(IsCsvEventHeader("x,y,p,t"));
  EXPECT_TRUE(IsCsvEventHeader("\"timestamp\" \"x\" \"y\" \"polarity\""));
  EXPECT_FALSE(IsCsvEventHeader("1,2,1,4"));
  EXPECT_FALSE(IsCsvEventHeader("x,2,1,4"));
  ASSERT_OK_AND_ASSIGN(const CsvEventColumns columns,
                       ParseCsvEventHeader("\"timestamp_s\";frame;X;Y;Polarity"));
  EXPECT_EQ(columns.time_unit, TimeUnit::kSeconds);
  const PlainEvent event = Read("0.5;77;3;4;1", columns.time_unit, columns);
  EXPECT_EQ(event, (PlainEvent{.time_us = 500'000, .x = 3, .y = 4, .kind = PlainEvent::kOn}));
  EXPECT_THAT(ParseCsvEventHeader("x,y,time"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no column p")));
  EXPECT_THAT(ParseCsvEventHeader("timestamp_ns;x0;y0"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no column x, y, p")));
}

TEST(CsvEventLine, Orders) {
  ASSERT_OK_AND_ASSIGN(const CsvEventColumns columns, ParseCsvEventOrder("txyp"));
  EXPECT_EQ(Read("99 3 4 0", TimeUnit::kMicroseconds, columns),
            (PlainEvent{.time_us = 99, .x = 3, .y = 4, .kind = PlainEvent::kOff}));
  for (const char* const order : {"", "xyp", "xyptt", "xxyp", "abcd"}) {
    EXPECT_THAT(ParseCsvEventOrder(order),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("txyp")));
  }
}

TEST(CsvEventLine, FractionsThatMeanSeconds) {
  EXPECT_TRUE(HasTimeFraction("1,2,1,0.001", {}));
  EXPECT_TRUE(HasTimeFraction("1,2,1,1e-3", {}));
  EXPECT_FALSE(HasTimeFraction("1,2,1,1000", {}));
  EXPECT_FALSE(HasTimeFraction("1,2,1,1000.0", {}));
  EXPECT_FALSE(HasTimeFraction("1,2,1,what", {}));
  EXPECT_FALSE(HasTimeFraction("1,2,0.5", {}));
}

}  // namespace
}  // namespace rigcal::agent::csv_event_line_test
