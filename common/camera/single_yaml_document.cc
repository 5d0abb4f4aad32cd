// SPDX-License-Identifier: Apache-2.0
#include "common/camera/single_yaml_document.h"

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

// OpenCV's parser recurses once per level and has no limit of its own.
constexpr int kMaxNesting = 32;

// Refuses what OpenCV's parser does not survive: bytes that are not text, and deep nesting.
absl::Status CheckBytes(const std::string& path, const std::string& text) {
  int line = 1;
  int depth = 0;
  int dashes = 0;  // "- - - -" nests as well
  for (const char c : text) {
    const unsigned char byte = static_cast<unsigned char>(c);
    if ((byte < 0x20 && c != '\n' && c != '\r' && c != '\t') || byte == 0x7f) {
      return YamlLineError(path, line,
                           absl::StrCat("byte 0x", absl::Hex(byte), " is not text; is this YAML?"));
    }
    if (c == '[' || c == '{') ++depth;
    if ((c == ']' || c == '}') && depth > 0) --depth;
    if (c == '-') ++dashes;
    if (c != '-' && c != ' ') dashes = 0;
    if (depth > kMaxNesting || dashes > kMaxNesting) {
      return YamlLineError(path, line, absl::StrCat("nested more than ", kMaxNesting, " deep"));
    }
    if (c == '\n') ++line;
  }
  return absl::OkStatus();
}

// A line of the one document that a calibration file has: a field, or part of a field.
bool IsFieldLine(absl::string_view row, bool first) {
  const size_t begin = row.find_first_not_of(' ');
  const char c = row[begin];
  if (begin == 0 && (absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_')) return true;
  if (first || begin == 0) return false;
  const bool dashes = c == '-' && begin + 1 < row.size() && row[begin + 1] == '-';
  return absl::ascii_isgraph(static_cast<unsigned char>(c)) && !dashes;
}

}  // namespace

absl::Status YamlLineError(const std::string& path, int line, const std::string& why) {
  return absl::InvalidArgumentError(absl::StrCat(path, ", line ", line, ": ", why));
}

absl::StatusOr<std::string> SingleDocument(const std::string& path, const std::string& text) {
  if (text.find_first_not_of(" \t\r\n") == std::string::npos) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": is empty"));
  }
  if (!absl::StartsWith(text, "%YAML")) {
    return YamlLineError(path, 1,
                         "does not begin with %YAML:1.0, as OpenCV's calibration files do");
  }
  RIGCAL_RETURN_IF_ERROR(CheckBytes(path, text));
  std::string document = "%YAML:1.0\n";
  int line = 0;
  bool first = true;
  for (absl::string_view row : absl::StrSplit(text, '\n')) {
    if (++line == 1) continue;
    row = absl::StripTrailingAsciiWhitespace(row);
    if (row == "...") break;
    const bool skipped =
        row.empty() || absl::StripLeadingAsciiWhitespace(row)[0] == '#' || (first && row == "---");
    if (!skipped) {
      if (row.find('\t') != absl::string_view::npos) {
        return YamlLineError(path, line, "has a tab; YAML is indented by spaces");
      }
      if (!IsFieldLine(row, first)) {
        return YamlLineError(path, line,
                             "is neither a field (\"image_width: 1280\") nor part of one");
      }
      first = false;
      absl::StrAppend(&document, row);
    }
    absl::StrAppend(&document, "\n");
  }
  return document;
}

}  // namespace rigcal
