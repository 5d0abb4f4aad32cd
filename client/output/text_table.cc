// SPDX-License-Identifier: Apache-2.0
#include "client/output/text_table.h"

#include <algorithm>
#include <utility>

#include "client/output/console.h"

namespace rigcal::client {
namespace {

constexpr size_t kGap = 2;

std::string Padding(std::string_view text, size_t width) {
  const size_t used = DisplayWidth(text);
  return std::string(width > used ? width - used : 0, ' ');
}

void AppendLine(std::string line, int indent, std::string* text) {
  line.erase(line.find_last_not_of(' ') + 1);
  if (!line.empty()) text->append(static_cast<size_t>(std::max(indent, 0)), ' ');
  text->append(line);
  text->push_back('\n');
}

// Runs of neighbouring columns with the same group, as [begin, end).
std::vector<std::pair<size_t, size_t>> GroupRuns(const std::vector<TextTable::Column>& columns) {
  std::vector<std::pair<size_t, size_t>> runs;
  for (size_t i = 0; i < columns.size(); ++i) {
    if (!runs.empty() && columns[runs.back().first].group == columns[i].group) {
      runs.back().second = i + 1;
    } else {
      runs.emplace_back(i, i + 1);
    }
  }
  return runs;
}

}  // namespace

size_t DisplayWidth(std::string_view text) {
  return static_cast<size_t>(std::count_if(text.begin(), text.end(), [](char character) {
    return (static_cast<unsigned char>(character) & 0xC0U) != 0x80U;
  }));
}

void TextTable::AddRow(std::vector<std::string> cells) {
  cells.resize(columns_.size());
  for (std::string& cell : cells) {
    cell = Printable(cell);
    std::replace(cell.begin(), cell.end(), '\n', ' ');
  }
  rows_.push_back(std::move(cells));
}

std::string TextTable::Format(int indent) const {
  std::vector<size_t> widths;
  for (size_t i = 0; i < columns_.size(); ++i) {
    size_t width = DisplayWidth(columns_[i].head);
    for (const std::vector<std::string>& row : rows_) {
      width = std::max(width, DisplayWidth(row[i]));
    }
    widths.push_back(width);
  }

  std::string text;
  const bool has_groups = std::any_of(columns_.begin(), columns_.end(),
                                      [](const Column& column) { return !column.group.empty(); });
  if (has_groups) {
    std::string line;
    for (const auto& [begin, end] : GroupRuns(columns_)) {
      const std::string& group = columns_[begin].group;
      size_t width = (end - begin - 1) * kGap;
      for (size_t i = begin; i < end; ++i) width += widths[i];
      // A group that is wider than its columns widens the first of them.
      if (const size_t wanted = DisplayWidth(group); wanted > width) {
        widths[begin] += wanted - width;
        width = wanted;
      }
      const std::string padding = Padding(group, width);
      const bool right = columns_[begin].align == Align::kRight;
      line += (right ? padding + group : group + padding) + std::string(kGap, ' ');
    }
    AppendLine(line, indent, &text);
  }

  const auto append_cells = [&](auto cell_of) {
    std::string line;
    for (size_t i = 0; i < columns_.size(); ++i) {
      const std::string& cell = cell_of(i);
      const std::string padding = Padding(cell, widths[i]);
      line += columns_[i].align == Align::kRight ? padding + cell : cell + padding;
      line.append(kGap, ' ');
    }
    AppendLine(line, indent, &text);
  };
  append_cells([&](size_t i) -> const std::string& { return columns_[i].head; });
  for (const std::vector<std::string>& row : rows_) {
    append_cells([&](size_t i) -> const std::string& { return row[i]; });
  }
  return text;
}

}  // namespace rigcal::client
