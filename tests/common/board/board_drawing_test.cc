// SPDX-License-Identifier: Apache-2.0
#include "common/board/board_drawing.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>
#include <string>
#include <vector>

namespace rigcal::board_drawing_test {
namespace {

using ::testing::HasSubstr;

// The values of these attributes, element by element.
std::vector<std::vector<double>> Elements(const std::string& svg, const std::string& pattern) {
  std::vector<std::vector<double>> elements;
  const std::regex regex(pattern);
  for (std::sregex_iterator it(svg.begin(), svg.end(), regex), end; it != end; ++it) {
    std::vector<double> values;
    for (size_t i = 1; i < it->size(); ++i) values.push_back(std::stod((*it)[i]));
    elements.push_back(values);
  }
  return elements;
}

TEST(BoardDrawing, ChecksAreToScale) {
  const std::string svg = BoardSvg(*ParseBoard("board:checker,9x6,0.03"));
  const auto page =
      Elements(svg,
               "<svg [^>]*width=\"([0-9.]+)mm\" height=\"([0-9.]+)mm\" viewBox=\"0 0 ([0-9.]+) "
               "([0-9.]+)\"");
  ASSERT_EQ(page.size(), 1u);
  EXPECT_EQ(page[0][0], page[0][2]);
  EXPECT_EQ(page[0][1], page[0][3]);
  EXPECT_EQ(page[0][0], 10 * 30 + 2 * 30);
  const auto squares = Elements(
      svg, "<rect x=\"([0-9.]+)\" y=\"([0-9.]+)\" width=\"([0-9.]+)\" height=\"([0-9.]+)\"/>");
  ASSERT_EQ(squares.size(), 35u);  // half of 10 x 7
  double right = 0, bottom = 0;
  for (const auto& square : squares) {
    EXPECT_EQ(square[2], 30);
    EXPECT_EQ(square[3], 30);
    EXPECT_GE(square[0], 30);  // the quiet zone
    EXPECT_GE(square[1], 30);
    right = std::max(right, square[0] + square[2]);
    bottom = std::max(bottom, square[1] + square[3]);
  }
  EXPECT_LE(right, page[0][0] - 30);
  EXPECT_LE(bottom, page[0][1] - 30);
}

TEST(BoardDrawing, CirclesAreWhereTheirPointsAre) {
  const Board board = *ParseBoard("board:circles,4x11,0.02");
  const auto circles =
      Elements(BoardSvg(board), "<circle cx=\"([0-9.]+)\" cy=\"([0-9.]+)\" r=\"([0-9.]+)\"/>");
  const auto points = board.Points();
  ASSERT_EQ(circles.size(), points.size());
  for (size_t i = 0; i < points.size(); ++i) {
    EXPECT_NEAR(circles[i][0] - circles[0][0], 1000 * points[i].x(), 1e-3);
    EXPECT_NEAR(circles[i][1] - circles[0][1], 1000 * points[i].y(), 1e-3);
    EXPECT_LT(2 * circles[i][2], 28);  // nearest neighbours do not touch
  }
}

TEST(BoardDrawing, RulerIsAHundredMillimetres) {
  for (const char* text : {"board:checker,9x6,0.03", "board:circles-symmetric,3x3,0.005"}) {
    const std::string svg = BoardSvg(*ParseBoard(text));
    const auto ruler = Elements(svg,
                                "id=\"ruler-100mm\" x1=\"([0-9.]+)\" y1=\"([0-9.]+)\" "
                                "x2=\"([0-9.]+)\" y2=\"([0-9.]+)\"");
    ASSERT_EQ(ruler.size(), 1u);
    EXPECT_NEAR(ruler[0][2] - ruler[0][0], 100, 1e-9);
    EXPECT_EQ(ruler[0][1], ruler[0][3]);
    EXPECT_LT(ruler[0][2], SheetOf(*ParseBoard(text)).width_mm);
    EXPECT_THAT(svg, HasSubstr(std::string(">") + text + "<"));
  }
}

// Of both sheets, with x counted from the right on the back: what is pierced through.
TEST(BoardDrawing, BothSheetsOfABoardLieOnEachOther) {
  for (const char* text : {"board:charuco,10x7,0.025,0.018,5x5_100,two-sided=0.004",
                           "board:aprilgrid,3x3,0.02,0.3,two-sided=0.004"}) {
    const Board board = *ParseBoard(text);
    const std::string front = BoardSvg(board), back = BoardSvg(board, BoardSide::kBack);
    const BoardSheet sheet = SheetOf(board);
    const auto points = board.Points();
    const double up = board.kind == BoardKind::kAprilGrid ? -1 : 1;
    for (int i = 0; i < board.side_point_count(); ++i) {
      // Both fronts have the same layout on their sheets.
      const Eigen::Vector3d& own = points[static_cast<size_t>(i)];
      const Eigen::Vector3d& behind = points[static_cast<size_t>(board.side_point_count() + i)];
      const double from_right = sheet.width_mm - (sheet.first_point_x_mm + 1000 * own.x());
      EXPECT_NEAR(from_right, sheet.first_point_x_mm + 1000 * behind.x(), 1e-9);
      EXPECT_EQ(up * own.y(), up * behind.y());
    }
    const std::string cross =
        "<line x1=\"([0-9.]+)\" y1=\"([0-9.]+)\" x2=\"([0-9.]+)\" y2=\"([0-9.]+)\"/>";
    const auto crosses_of = [&](const std::string& svg) {
      const size_t begin = svg.find("id=\"crosses\"");
      return Elements(svg.substr(begin, svg.find("</g>", begin) - begin), cross);
    };
    const auto crosses = crosses_of(front);
    ASSERT_EQ(crosses.size(), 8u);  // four of two lines
    EXPECT_EQ(crosses, crosses_of(back));
    double left = 1e9, right = 0;
    for (const auto& line : crosses) {
      const double x = 0.5 * (line[0] + line[2]);
      left = std::min(left, x);
      right = std::max(right, x);
    }
    EXPECT_NEAR(left, sheet.width_mm - right, 1e-9);
    EXPECT_LT(left, sheet.margin_mm);
    EXPECT_NE(front, back);
    EXPECT_THAT(front, HasSubstr(std::string(">") + text + " (front)<"));
    EXPECT_THAT(back, HasSubstr(std::string(">") + text + " (back)<"));
    EXPECT_THAT(DescribeBoard(board), HasSubstr("two sides, 4 mm from print to print"));
  }
  // The back has markers of its own, whatever the front has.
  const Board board = *ParseBoard("board:charuco,10x7,0.025,0.018,5x5_100,two-sided=0.004");
  EXPECT_EQ(BoardSvg(board).find("crosses") == std::string::npos, false);
  EXPECT_EQ(BoardSvg(board.OneSide()).find("crosses"), std::string::npos);
}

TEST(BoardDrawing, DescriptionSaysSizesAndPaper) {
  const std::string text = DescribeBoard(*ParseBoard("board:checker,9x6,0.025"));
  EXPECT_THAT(text, HasSubstr("9 x 6 inner corners, which are 10 x 7 squares of 25 mm"));
  EXPECT_THAT(text,
              HasSubstr("pattern 250 x 175 mm, sheet with its white margin 300 x 245 mm (A3)"));
  EXPECT_THAT(DescribeBoard(*ParseBoard("board:checker,8x6,0.03")), HasSubstr("180 degrees"));
}

}  // namespace
}  // namespace rigcal::board_drawing_test
