// SPDX-License-Identifier: Apache-2.0
#include "client/output/text_table.h"

#include <algorithm>
#include <utility>

#include "client/output/console.h"

namespace rigcal::client {
namespace {

constexpr size_t kGap = 2;
// Columns of words are not made narrower than that and their heads.
constexpr size_t kLeastWords = 10;

// Terminal columns that tables may take; 0: any number. Set once, at the start of the program.
size_t columns_to_fit = 0;

// Breaks text into lines of at most `width` terminal columns, between words where it can.
std::vector<std::string> WrapCell(const std::string& text, size_t width) {
  std::vector<std::string> lines;
  std::string line;
  size_t columns = 0;
  size_t space = std::string::npos;  // the last one in `line`
  for (size_t i = 0; i < text.size();) {
    size_t end = i + 1;
    while (end < text.size() && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) ++end;
    if (columns == width && text[i] != ' ') {
      const bool between = space != std::string::npos && space > 0;
      std::string rest = between ? line.substr(space + 1) : "";
      lines.push_back(between ? line.substr(0, space) : line);
      line = std::move(rest);
      columns = DisplayWidth(line);
      space = std::string::npos;
    } else if (columns == width) {
      lines.push_back(std::exchange(line, ""));
      columns = 0;
      space = std::string::npos;
      i = end;
      continue;
    }
    if (text[i] == ' ') space = line.size();
    line.append(text, i, end - i);
    ++columns;
    i = end;
  }
  if (!line.empty() || lines.empty()) lines.push_back(std::move(line));
  return lines;
}

void AppendCell(const std::string& cell, size_t width, bool right, std::string* line) {
  const std::string padding(width - std::min(width, DisplayWidth(cell)), ' ');
  *line += right ? padding + cell : cell + padding;
  line->append(kGap, ' ');
}

void AppendLine(std::string line, size_t indent, std::string* text) {
  line.erase(line.find_last_not_of(' ') + 1);
  if (!line.empty()) text->append(indent, ' ');
  *text += line + "\n";
}

}  // namespace

size_t DisplayWidth(std::string_view text) {
  return static_cast<size_t>(std::count_if(text.begin(), text.end(), [](char character) {
    return (static_cast<unsigned char>(character) & 0xC0U) != 0x80U;
  }));
}

TextTable& TextTable::Words(std::initializer_list<const char*> heads) {
  columns_.resize(columns_.size() + heads.size());
  lines_[0].insert(lines_[0].end(), heads.begin(), heads.end());
  return *this;
}

TextTable& TextTable::Numbers(std::initializer_list<const char*> heads, const std::string& group) {
  columns_.resize(columns_.size() + heads.size(), {.is_number = true, .group = group});
  lines_[0].insert(lines_[0].end(), heads.begin(), heads.end());
  return *this;
}

void TextTable::AddRow(const std::vector<Cell>& cells) {
  std::vector<std::string>& line = lines_.emplace_back(columns_.size());
  for (size_t i = 0; i < std::min(cells.size(), line.size()); ++i) {
    line[i] = Printable(cells[i].text);
    std::replace(line[i].begin(), line[i].end(), '\n', ' ');
  }
}

void TextTable::FitTo(size_t columns) { columns_to_fit = columns; }

void TextTable::Narrow(size_t indent, std::vector<size_t>* widths) const {
  size_t total = indent;
  for (const size_t width : *widths) total += width + kGap;
  // The gap behind the last column is cut off.
  total -= std::min(total, kGap);
  while (columns_to_fit > 0 && total > columns_to_fit) {
    size_t widest = widths->size();
    for (size_t i = 0; i < widths->size(); ++i) {
      const size_t least = std::max(kLeastWords, DisplayWidth(lines_[0][i]));
      if (columns_[i].is_number || (*widths)[i] <= least) continue;
      if (widest == widths->size() || (*widths)[i] > (*widths)[widest]) widest = i;
    }
    if (widest == widths->size()) return;
    --(*widths)[widest];
    --total;
  }
}

std::string TextTable::Format(size_t indent) const {
  std::vector<size_t> widths(columns_.size());
  for (const std::vector<std::string>& line : lines_) {
    for (size_t i = 0; i < line.size(); ++i) widths[i] = std::max(widths[i], DisplayWidth(line[i]));
  }

  Narrow(indent, &widths);
  std::string text;
  const bool has_groups = std::any_of(columns_.begin(), columns_.end(),
                                      [](const Column& column) { return !column.group.empty(); });
  if (has_groups) {
    std::string line;
    for (size_t begin = 0, end = 0; begin < columns_.size(); begin = end) {
      const auto& [is_number, group] = columns_[begin];
      size_t width = widths[begin];
      for (end = begin + 1; end < columns_.size() && columns_[end].group == group; ++end) {
        width += kGap + widths[end];
      }
      // A group that is wider than its columns widens the first of them.
      const size_t more = DisplayWidth(group) - std::min(width, DisplayWidth(group));
      widths[begin] += more;
      AppendCell(group, width + more, is_number, &line);
    }
    AppendLine(line, indent, &text);
  }

  for (const std::vector<std::string>& cells : lines_) {
    std::vector<std::vector<std::string>> wrapped;
    size_t height = 1;
    for (size_t i = 0; i < cells.size(); ++i) {
      wrapped.push_back(columns_[i].is_number ? std::vector<std::string>{cells[i]}
                                              : WrapCell(cells[i], widths[i]));
      height = std::max(height, wrapped.back().size());
    }
    for (size_t row = 0; row < height; ++row) {
      std::string line;
      for (size_t i = 0; i < cells.size(); ++i) {
        AppendCell(row < wrapped[i].size() ? wrapped[i][row] : "", widths[i], columns_[i].is_number,
                   &line);
      }
      AppendLine(line, indent, &text);
    }
  }
  return text;
}

}  // namespace rigcal::client
