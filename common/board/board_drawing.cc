// SPDX-License-Identifier: Apache-2.0
#include "common/board/board_drawing.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/board/marker_cells.h"

namespace rigcal {
namespace {

constexpr double kRulerMm = 100;
constexpr double kRulerTickMm = 10;
constexpr double kTextHeightMm = 4;
constexpr double kFooterMm = 20;  // ruler and text
constexpr double kLeastMarginMm = 10;
constexpr double kCrossMm = 6;  // across

struct Paper {
  const char* name;
  double short_mm;
  double long_mm;
};
constexpr Paper kPapers[] = {
    {"A4", 210, 297}, {"A3", 297, 420}, {"A2", 420, 594}, {"A1", 594, 841}, {"A0", 841, 1189}};

std::string PaperFor(const BoardSheet& sheet) {
  const double longer = std::max(sheet.width_mm, sheet.height_mm);
  const double shorter = std::min(sheet.width_mm, sheet.height_mm);
  for (const Paper& paper : kPapers) {
    if (shorter <= paper.short_mm && longer <= paper.long_mm) return paper.name;
  }
  return "larger than A0";
}

void DrawChecker(const Board& board, const BoardSheet& sheet, std::string* svg) {
  const double side = 1000 * board.spacing_m;
  for (int row = 0; row <= board.rows; ++row) {
    for (int column = row % 2; column <= board.columns; column += 2) {
      absl::StrAppendFormat(svg, "<rect x=\"%.4f\" y=\"%.4f\" width=\"%.4f\" height=\"%.4f\"/>\n",
                            sheet.first_point_x_mm + (column - 1) * side,
                            sheet.first_point_y_mm + (row - 1) * side, side, side);
    }
  }
}

void DrawMarkers(const Board& board, BoardSide side, const BoardSheet& sheet, std::string* svg) {
  const double left = 0.5 * (sheet.width_mm - sheet.pattern_width_mm);
  for (const BlackCell& cell : MarkerCells(board, side)) {
    absl::StrAppendFormat(svg, "<rect x=\"%.4f\" y=\"%.4f\" width=\"%.4f\" height=\"%.4f\"/>\n",
                          left + 1000 * cell.x_m, sheet.margin_mm + 1000 * cell.y_m,
                          1000 * cell.side_m, 1000 * cell.side_m);
  }
}

void DrawCircles(const Board& board, const BoardSheet& sheet, std::string* svg) {
  for (const Eigen::Vector3d& point : board.Points()) {
    absl::StrAppendFormat(svg, "<circle cx=\"%.4f\" cy=\"%.4f\" r=\"%.4f\"/>\n",
                          sheet.first_point_x_mm + 1000 * point.x(),
                          sheet.first_point_y_mm + 1000 * point.y(),
                          0.5 * sheet.circle_diameter_mm);
  }
}

// Where both sheets of a board with two sides are pierced, in the middle of the margin.
void DrawCrosses(const BoardSheet& sheet, std::string* svg) {
  *svg += "<g id=\"crosses\" stroke=\"black\" stroke-width=\"0.2\">\n";
  const double inset = 0.5 * sheet.margin_mm;
  for (const double x : {inset, sheet.width_mm - inset}) {
    for (const double y : {inset, sheet.height_mm - inset}) {
      for (const auto& [dx, dy] :
           {std::pair(0.5 * kCrossMm, 0.0), std::pair(0.0, 0.5 * kCrossMm)}) {
        absl::StrAppendFormat(svg, "<line x1=\"%.4f\" y1=\"%.4f\" x2=\"%.4f\" y2=\"%.4f\"/>\n",
                              x - dx, y - dy, x + dx, y + dy);
      }
    }
  }
  *svg += "</g>\n";
}

}  // namespace

BoardSheet SheetOf(const Board& board) {
  BoardSheet sheet;
  const double spacing = 1000 * board.spacing_m;
  double beyond = spacing;  // from the outer points to the pattern's edge
  if (board.HasCircles()) {
    sheet.circle_diameter_mm = 1000 * board.CircleDiameter();
    beyond = 0.5 * sheet.circle_diameter_mm;
  } else if (board.kind == BoardKind::kAprilGrid) {
    beyond = board.gap_share * spacing;
  }
  double right = 0, bottom = 0;
  for (const Eigen::Vector3d& point : board.OneSide().Points()) {
    right = std::max(right, 1000 * point.x());
    bottom = std::max(bottom, 1000 * point.y());
  }
  sheet.pattern_width_mm = right + 2 * beyond;
  sheet.pattern_height_mm = bottom + 2 * beyond;
  sheet.margin_mm = std::max(spacing, kLeastMarginMm);
  sheet.width_mm = std::max(sheet.pattern_width_mm, kRulerMm) + 2 * sheet.margin_mm;
  sheet.height_mm = sheet.pattern_height_mm + 2 * sheet.margin_mm + kFooterMm;
  sheet.first_point_x_mm = 0.5 * (sheet.width_mm - sheet.pattern_width_mm) + beyond;
  // An April grid begins at the bottom.
  sheet.first_point_y_mm =
      sheet.margin_mm + beyond + (board.kind == BoardKind::kAprilGrid ? bottom : 0);
  return sheet;
}

std::string BoardSvg(const Board& board, BoardSide side) {
  const BoardSheet sheet = SheetOf(board);
  const std::string label =
      absl::StrCat(FormatBoard(board), !board.IsTwoSided()         ? ""
                                       : side == BoardSide::kFront ? " (front)"
                                                                   : " (back)");
  // The pattern and the crosses look alike when a sheet is upside down.
  const std::string note = absl::StrCat(
      "the ruler is 100 mm long",
      board.IsTwoSided() ? "; turn the board as a page: this text is at the bottom of both sides"
                         : "");
  std::string svg = absl::StrFormat(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<!-- %s; one unit is a millimetre; print at 100 %% -->\n"
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.4fmm\" height=\"%.4fmm\" "
      "viewBox=\"0 0 %.4f %.4f\">\n"
      "<rect id=\"paper\" x=\"0\" y=\"0\" width=\"%.4f\" height=\"%.4f\" fill=\"white\"/>\n"
      "<g id=\"pattern\" fill=\"black\" shape-rendering=\"crispEdges\">\n",
      label, sheet.width_mm, sheet.height_mm, sheet.width_mm, sheet.height_mm, sheet.width_mm,
      sheet.height_mm);
  if (board.kind == BoardKind::kChecker) {
    DrawChecker(board, sheet, &svg);
  } else if (board.HasMarkers()) {
    DrawMarkers(board, side, sheet, &svg);
  } else {
    DrawCircles(board, sheet, &svg);
  }
  const double left = sheet.margin_mm;
  const double ruler = sheet.height_mm - kFooterMm;
  svg += "</g>\n";
  if (board.IsTwoSided()) DrawCrosses(sheet, &svg);
  svg += "<g id=\"ruler\" stroke=\"black\" stroke-width=\"0.2\">\n";
  absl::StrAppendFormat(&svg,
                        "<line id=\"ruler-100mm\" x1=\"%.4f\" y1=\"%.4f\" x2=\"%.4f\" "
                        "y2=\"%.4f\"/>\n",
                        left, ruler, left + kRulerMm, ruler);
  for (double at = 0; at <= kRulerMm; at += kRulerTickMm) {
    absl::StrAppendFormat(&svg, "<line x1=\"%.4f\" y1=\"%.4f\" x2=\"%.4f\" y2=\"%.4f\"/>\n",
                          left + at, ruler - 2, left + at, ruler);
  }
  absl::StrAppendFormat(
      &svg,
      "</g>\n<text x=\"%.4f\" y=\"%.4f\" font-family=\"sans-serif\" font-size=\"%.1f\">%s"
      "</text>\n<text x=\"%.4f\" y=\"%.4f\" font-family=\"sans-serif\" font-size=\"%.1f\">%s"
      "</text>\n</svg>\n",
      left, ruler + 1.5 * kTextHeightMm, kTextHeightMm, label, left, ruler + 3 * kTextHeightMm,
      kTextHeightMm, note);
  return svg;
}

std::string DescribeBoard(const Board& board) {
  const BoardSheet sheet = SheetOf(board);
  std::string text = FormatBoard(board) + "\n";
  const double spacing = 1000 * board.spacing_m;
  switch (board.kind) {
    case BoardKind::kChecker:
      absl::StrAppendFormat(&text, "%d x %d inner corners, which are %d x %d squares of %g mm\n",
                            board.columns, board.rows, board.columns + 1, board.rows + 1, spacing);
      break;
    case BoardKind::kCircles:
      absl::StrAppendFormat(&text,
                            "%d circles in each of %d rows, every second row shifted by %g mm; %g "
                            "mm from row to row, %g mm along a row\n",
                            board.columns, board.rows, spacing, spacing, 2 * spacing);
      break;
    case BoardKind::kCirclesSymmetric:
      absl::StrAppendFormat(&text, "%d x %d circles, %g mm from centre to centre\n", board.columns,
                            board.rows, spacing);
      break;
    case BoardKind::kCharuco:
      absl::StrAppendFormat(
          &text, "%d x %d squares of %g mm with markers of %g mm (%s) in the white ones\n",
          board.columns + 1, board.rows + 1, spacing, 1000 * board.marker_m, board.dictionary);
      break;
    case BoardKind::kAprilGrid:
      absl::StrAppendFormat(&text,
                            "%d x %d tags (36h11) of %g mm, %g mm apart, as kalibr has them\n",
                            board.columns / 2, board.rows / 2, spacing, board.gap_share * spacing);
      break;
  }
  if (sheet.circle_diameter_mm > 0) {
    absl::StrAppendFormat(&text, "circles of %.1f mm\n", sheet.circle_diameter_mm);
  }
  absl::StrAppendFormat(&text,
                        "pattern %.0f x %.0f mm, sheet with its white margin %.0f x %.0f mm (%s)\n",
                        sheet.pattern_width_mm, sheet.pattern_height_mm, sheet.width_mm,
                        sheet.height_mm, PaperFor(sheet));
  if (board.IsTwoSided()) {
    absl::StrAppendFormat(
        &text,
        "two sides, %g mm from print to print; the back has markers %d to %d\n"
        "turn the board about its vertical middle line, as a page, and the back is upright: pierce "
        "the crosses of both sheets, put the back's upper left one on the front's upper right one, "
        "measure the thickness with both sheets glued on, and say that\n",
        1000 * board.thickness_m, board.side_marker_count(), 2 * board.side_marker_count() - 1);
  }
  if (board.HasTwin()) {
    text += "it looks the same turned by 180 degrees, which does not matter for a lens\n";
  }
  absl::StrAppend(&text,
                  "print at 100 %, glue it on something flat and stiff, measure the ruler: if it "
                  "is not 100 mm long, measure the spacing and say that\n");
  return text;
}

}  // namespace rigcal
