// SPDX-License-Identifier: Apache-2.0
#include "common/text/nesting.h"

#include <algorithm>
#include <vector>

namespace rigcal {
namespace {

// The text, read from the front, and the number of its line.
class NestedText {
 public:
  explicit NestedText(std::string_view text) : text_(text) {}

  bool at_end() const { return text_.empty(); }
  int line() const { return line_; }
  char Next() {
    const char c = text_.front();
    Skip(1);
    return c;
  }
  bool StartsWith(std::string_view prefix) const { return text_.starts_with(prefix); }
  void Skip(size_t count) {
    count = std::min(count, text_.size());
    line_ += static_cast<int>(std::ranges::count(text_.substr(0, count), '\n'));
    text_.remove_prefix(count);
  }
  // To behind `end`, or to the end of the text.
  void SkipPast(std::string_view end) {
    const size_t at = text_.find(end);
    Skip(at == std::string_view::npos ? text_.size() : at + end.size());
  }
  // To the end of the line, without its newline.
  void SkipLine() { Skip(std::min(text_.find('\n'), text_.size())); }
  // The rest of a text in quotes; one on a line of its own also ends with the line.
  void SkipQuoted(char quote, bool has_escapes, bool one_line) {
    while (!at_end() && !(one_line && text_.front() == '\n')) {
      const char c = Next();
      if (c == quote) return;
      if (c == '\\' && has_escapes) Skip(1);
    }
  }

 private:
  std::string_view text_;
  int line_ = 1;
};

std::optional<int> DeepLineOfJson(std::string_view text) {
  NestedText rest(text);
  size_t depth = 0;
  while (!rest.at_end()) {
    const char c = rest.Next();
    if (c == '"') rest.SkipQuoted('"', /*has_escapes=*/true, /*one_line=*/false);
    if ((c == ']' || c == '}') && depth > 0) --depth;
    if ((c == '[' || c == '{') && ++depth > kMostNested) return rest.line();
  }
  return std::nullopt;
}

// A text of TOML: '...', "...", '''...''' or """...""", of which the last two end with up to five
// quotes.
void SkipTomlText(char quote, NestedText* rest) {
  const std::string_view three = quote == '"' ? "\"\"\"" : "'''";
  const bool has_escapes = quote == '"';
  if (!rest->StartsWith(three.substr(1))) {
    return rest->SkipQuoted(quote, has_escapes, /*one_line=*/true);
  }
  rest->Skip(2);
  while (!rest->at_end()) {
    if (rest->StartsWith(three)) {
      rest->Skip(3);
      for (int i = 0; i < 2 && rest->StartsWith(three.substr(2)); ++i) rest->Skip(1);
      return;
    }
    if (rest->Next() == '\\' && has_escapes) rest->Skip(1);
  }
}

// A table nests by the dots of its header and of its keys, and by brackets.
std::optional<int> DeepLineOfToml(std::string_view text) {
  NestedText rest(text);
  size_t header = 0;  // levels of the table that the lines belong to
  size_t depth = 0;
  std::vector<size_t> outside;  // the depths in which brackets were opened
  bool line_begins = true;
  bool in_header = false;
  while (!rest.at_end()) {
    const char c = rest.Next();
    const bool begins = line_begins;
    if (c == ' ' || c == '\t' || c == '\r') continue;
    line_begins = false;
    if (c == '#') {
      rest.SkipLine();
    } else if (c == '"' || c == '\'') {
      SkipTomlText(c, &rest);
    } else if (c == '\n') {
      in_header = false;
      depth = outside.empty() ? header : outside.back() + 1;
      line_begins = outside.empty();
    } else if (c == '[' && (begins || (in_header && header == 1))) {
      in_header = true;
      header = depth = begins ? 1 : 2;
    } else if (c == '[' || c == '{') {
      outside.push_back(depth++);
    } else if ((c == ']' || c == '}') && !in_header && !outside.empty()) {
      depth = outside.back();
      outside.pop_back();
    } else if (c == '.') {
      ++depth;
      if (in_header) header = depth;
    } else if (c == ',' && !outside.empty()) {
      depth = outside.back() + 1;
    }
    if (depth > kMostNested) return rest.line();
  }
  return std::nullopt;
}

// Lists and maps of YAML nest by indentation, by "- - -" on one line, and by brackets.
std::optional<int> DeepLineOfYaml(std::string_view text) {
  std::vector<size_t> indents;
  size_t brackets = 0;
  for (int line = 1; !text.empty(); ++line) {
    const size_t end = std::min(text.find('\n'), text.size());
    const std::string_view row = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    size_t column = row.find_first_not_of(" \t\r");
    if (column == std::string_view::npos) continue;
    while (!indents.empty() && indents.back() >= column) indents.pop_back();
    indents.push_back(column);
    while (column < row.size() &&
           (row[column] == '-' || row[column] == '?' || row[column] == ':')) {
      const size_t next = row.find_first_not_of(" \t\r", column + 1);
      if (next == column + 1 && row[next] != '-') break;  // "-1"
      if (next == std::string_view::npos) break;
      column = next;
      indents.push_back(column);
    }
    const bool closes = row.find_first_of("\"'#") == std::string_view::npos;
    for (const char c : row) {
      if (c == '[' || c == '{') ++brackets;
      if ((c == ']' || c == '}') && closes && brackets > 0) --brackets;
      if (indents.size() + brackets > kMostNested) return line;
    }
  }
  return std::nullopt;
}

std::optional<int> DeepLineOfXml(std::string_view text) {
  NestedText rest(text);
  size_t depth = 0;
  while (!rest.at_end()) {
    if (rest.StartsWith("<!--")) {
      rest.SkipPast("-->");
    } else if (rest.StartsWith("<![CDATA[")) {
      rest.SkipPast("]]>");
    } else if (rest.StartsWith("<?")) {
      rest.SkipPast("?>");
    } else if (rest.StartsWith("</")) {
      if (depth > 0) --depth;
      rest.SkipPast(">");
    } else if (rest.Next() == '<') {
      if (++depth > kMostNested) return rest.line();
      for (char c = 0, before = 0; !rest.at_end() && c != '>'; before = c) {
        c = rest.Next();
        if (c == '"' || c == '\'') rest.SkipQuoted(c, /*has_escapes=*/false, /*one_line=*/false);
        // An empty element, or a declaration, which has no end of its own.
        if (c == '>' && before == '/') --depth;
      }
    }
  }
  return std::nullopt;
}

}  // namespace

std::optional<int> LineNestedTooDeep(NestedFormat format, std::string_view text) {
  switch (format) {
    case NestedFormat::kJson:
      return DeepLineOfJson(text);
    case NestedFormat::kToml:
      return DeepLineOfToml(text);
    case NestedFormat::kYaml:
      return DeepLineOfYaml(text);
    case NestedFormat::kXml:
      break;
  }
  return DeepLineOfXml(text);
}

}  // namespace rigcal
