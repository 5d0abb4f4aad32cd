// SPDX-License-Identifier: Apache-2.0
#include "client/output/grade_colour.h"

#include "absl/strings/str_cat.h"

namespace rigcal::client {
namespace {

constexpr std::string_view kHead = "quality";
constexpr std::string_view kLine = "Quality: ";

const char* ColourOf(std::string_view grade) {
  if (grade == "good") return "\x1b[32m";
  if (grade == "usable") return "\x1b[33m";
  if (grade == "bad") return "\x1b[31m";
  return nullptr;
}

// Where the n-th code point begins; npos: there are fewer.
size_t ByteOfColumn(std::string_view line, size_t column) {
  for (size_t i = 0; i < line.size(); ++i) {
    if ((static_cast<unsigned char>(line[i]) & 0xC0U) == 0x80U) continue;
    if (column-- == 0) return i;
  }
  return std::string_view::npos;
}

std::string ColourWordAt(std::string_view line, size_t begin) {
  const std::string_view word = line.substr(begin, line.find(' ', begin) - begin);
  const char* const colour = ColourOf(word);
  if (colour == nullptr) return std::string(line);
  return absl::StrCat(std::string(line.substr(0, begin)), colour, std::string(word), "\x1b[0m",
                      std::string(line.substr(begin + word.size())));
}

// Column of the head "quality"; npos: the line is no such head.
size_t HeadColumn(std::string_view line) {
  const size_t at = line.find(kHead);
  if (at == std::string_view::npos) return at;
  const bool begins = at == 0 || (at > 1 && line.substr(at - 2, 2) == "  ");
  const std::string_view behind = line.substr(at + kHead.size());
  return begins && (behind.empty() || behind.starts_with("  ")) ? at : std::string_view::npos;
}

}  // namespace

std::string ColourGrades(std::string_view text) {
  std::string result;
  size_t column = std::string_view::npos;  // of the table that the line is in
  while (!text.empty()) {
    const size_t end = text.find('\n');
    const std::string_view line = text.substr(0, end);
    size_t begin = std::string_view::npos;
    if (line.starts_with(kLine)) {
      begin = kLine.size();
    } else if (column != std::string_view::npos) {
      begin = ByteOfColumn(line, column);
    }
    result += begin == std::string_view::npos ? std::string(line) : ColourWordAt(line, begin);
    if (line.empty()) column = std::string_view::npos;
    if (const size_t head = HeadColumn(line); head != std::string_view::npos) column = head;
    if (end == std::string_view::npos) break;
    result += '\n';
    text.remove_prefix(end + 1);
  }
  return result;
}

}  // namespace rigcal::client
