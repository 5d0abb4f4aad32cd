// SPDX-License-Identifier: Apache-2.0
#include "client/output/text_table.h"

#include <algorithm>

#include "client/output/console.h"

namespace rigcal::client {
namespace {

constexpr size_t kGap = 2;

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

std::string TextTable::Format(size_t indent) const {
  std::vector<size_t> widths(columns_.size());
  for (const std::vector<std::string>& line : lines_) {
    for (size_t i = 0; i < line.size(); ++i) widths[i] = std::max(widths[i], DisplayWidth(line[i]));
  }

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
    std::string line;
    for (size_t i = 0; i < cells.size(); ++i) {
      AppendCell(cells[i], widths[i], columns_[i].is_number, &line);
    }
    AppendLine(line, indent, &text);
  }
  return text;
}

}  // namespace rigcal::client
