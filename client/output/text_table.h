// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include "absl/strings/str_cat.h"

namespace rigcal::client {

// A table for people: columns separated by two spaces, words to the left, numbers to the right.
class TextTable {
 public:
  struct Cell {
    template <typename Text>
    Cell(const Text& cell) : text(absl::StrCat(cell)) {}

    std::string text;
  };

  // Columns with these heads. `group`: a second head above all of them, such as their unit and
  // meaning; empty: none.
  TextTable& Words(std::initializer_list<const char*> heads);
  TextTable& Numbers(std::initializer_list<const char*> heads, const std::string& group = "");

  // As many cells as columns, which are all there by now; missing ones are empty, further ones are
  // left out.
  void AddRow(const std::vector<Cell>& cells);
  bool empty() const { return lines_.size() == 1; }

  // Limits the width of all tables to `columns` characters: text in columns of words is wrapped. 0,
  // the default: no limit. Call it before any thread is started.
  static void FitTo(size_t columns);

  // Heads and rows, each line ended by a newline and without trailing spaces; `indent` spaces
  // before each line.
  std::string Format(size_t indent = 0) const;

 private:
  // Makes the widest columns of words narrower until the table fits.
  void Narrow(size_t indent, std::vector<size_t>* widths) const;

  struct Column {
    bool is_number = false;
    std::string group;
  };

  std::vector<Column> columns_;
  std::vector<std::vector<std::string>> lines_ = {{}};  // the heads, then the rows
};

// Number of terminal columns of UTF-8 text, taking each code point for one.
size_t DisplayWidth(std::string_view text);

}  // namespace rigcal::client
