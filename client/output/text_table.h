// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace rigcal::client {

// A table for people: columns separated by two spaces, words to the left, numbers to the right.
class TextTable {
 public:
  enum class Align { kLeft, kRight };
  struct Column {
    std::string head;
    Align align = Align::kLeft;
    // A second head above this one, shared by the columns beside it that have the same: the unit
    // and meaning of a group. Empty: none.
    std::string group = "";
  };

  // A column of numbers.
  static Column Number(std::string head, std::string group = "") {
    return {std::move(head), Align::kRight, std::move(group)};
  }

  explicit TextTable(std::vector<Column> columns) : columns_(std::move(columns)) {}

  // As many cells as columns; missing ones are empty, further ones are left out.
  void AddRow(std::vector<std::string> cells);
  bool empty() const { return rows_.empty(); }

  // Heads and rows, each line ended by a newline and without trailing spaces; `indent` spaces
  // before each line.
  std::string Format(int indent = 0) const;

 private:
  std::vector<Column> columns_;
  std::vector<std::vector<std::string>> rows_;
};

// Number of terminal columns of UTF-8 text, taking each code point for one.
size_t DisplayWidth(std::string_view text);

}  // namespace rigcal::client
