// SPDX-License-Identifier: Apache-2.0
#include "client/output/text_table.h"

#include <gtest/gtest.h>

namespace rigcal::client::text_table_test {
namespace {

TEST(TextTable, AlignsWordsLeftAndNumbersRight) {
  TextTable table;
  table.Words({"camera"}).Numbers({"mean"}).Words({"state"});
  table.AddRow({"left", "0.5", "ok"});
  table.AddRow({"right_hand", "12.25", "bad"});
  EXPECT_EQ(table.Format(),
            "camera       mean  state\n"
            "left          0.5  ok\n"
            "right_hand  12.25  bad\n");
}

TEST(TextTable, GroupStandsOnceAboveItsColumns) {
  TextTable table;
  table.Words({"camera"}).Numbers({"x", "y"}, "position (m)");
  table.AddRow({"left", "1.0000", "-2.0000"});
  EXPECT_EQ(table.Format(),
            "           position (m)\n"
            "camera       x        y\n"
            "left    1.0000  -2.0000\n");
}

TEST(TextTable, GroupWiderThanItsColumnsMakesRoom) {
  TextTable table;
  table.Words({"a"}).Numbers({"b"}, "a long group").Words({"c"});
  table.AddRow({"1", "2", "3"});
  EXPECT_EQ(table.Format(),
            "   a long group\n"
            "a             b  c\n"
            "1             2  3\n");
}

TEST(TextTable, IndentsEveryLine) {
  TextTable table;
  table.Words({"a"});
  table.AddRow({"b"});
  EXPECT_EQ(table.Format(2), "  a\n  b\n");
}

TEST(TextTable, CellsCannotSteerTheTerminalOrBreakTheRow) {
  TextTable table;
  table.Words({"a"});
  table.AddRow({"red\x1b[31m\ntwo"});
  EXPECT_EQ(table.Format(), "a\nred\\x1b[31m two\n");
}

TEST(TextTable, MissingCellsAreEmptyAndFurtherOnesLeftOut) {
  TextTable table;
  table.Words({"a", "b"});
  table.AddRow({"1"});
  table.AddRow({"1", "2", "3"});
  EXPECT_EQ(table.Format(), "a  b\n1\n1  2\n");
}

TEST(TextTable, CountsCodePointsNotBytes) {
  TextTable table;
  table.Words({"a", "b"});
  table.AddRow({"Größe", "x"});
  table.AddRow({"Grosse", "y"});
  EXPECT_EQ(table.Format(), "a       b\nGröße   x\nGrosse  y\n");
}

TEST(TextTable, FitsByBreakingWordsOnly) {
  TextTable table;
  table.Words({"finding"}).Numbers({"value"}).Words({"advice"});
  table.AddRow({"clock_offset", "-8.046", "its rows show the wand earlier than its stamps say"});
  table.AddRow({"b", "1", "none"});
  TextTable::FitTo(44);
  const std::string narrow = table.Format();
  TextTable::FitTo(0);
  EXPECT_EQ(narrow,
            "finding        value  advice\n"
            "clock_offset  -8.046  its rows show the wand\n"
            "                      earlier than its\n"
            "                      stamps say\n"
            "b                  1  none\n");
  EXPECT_EQ(std::string(table.Format()).find("wand\n"), std::string::npos);
}

TEST(TextTable, AWordThatIsTooLongIsBrokenAndNumbersAreNot) {
  TextTable table;
  table.Words({"file"}).Numbers({"bytes"});
  table.AddRow({"abcdefghijklmnop", "123456789012"});
  TextTable::FitTo(20);
  const std::string narrow = table.Format();
  TextTable::FitTo(0);
  EXPECT_EQ(narrow,
            "file               bytes\n"
            "abcdefghij  123456789012\n"
            "klmnop\n");
}

}  // namespace
}  // namespace rigcal::client::text_table_test
