// SPDX-License-Identifier: Apache-2.0
#include "common/target/target_words.h"

#include "absl/strings/ascii.h"

namespace rigcal {
namespace {

constexpr std::string_view kWritten = "wand";

// A letter, a digit or what joins words to a name or a path.
bool IsOfName(std::string_view text, size_t at) {
  if (at >= text.size()) return false;
  const char c = text[at];
  return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '/' || c == ':';
}

}  // namespace

std::string_view TargetWord(const Target& target) {
  if (!target.board.empty()) return "board";
  return target.IsLine() ? kWritten : "target";
}

std::string SpeakOf(const Target& target, std::string text) {
  const std::string_view word = TargetWord(target);
  if (word == kWritten) return text;
  for (size_t at = 0; at + kWritten.size() <= text.size(); ++at) {
    const bool is_capital = text[at] == 'W';
    if ((!is_capital && text[at] != 'w') ||
        std::string_view(text).substr(at + 1, kWritten.size() - 1) != kWritten.substr(1)) {
      continue;
    }
    size_t end = at + kWritten.size();
    if (end < text.size() && text[end] == 's') ++end;
    // "wand:" of a sentence is the word, "wand:0,0.13" is a target's text.
    const bool ends = !IsOfName(text, end) || (text[end] == ':' && !IsOfName(text, end + 1));
    if ((at > 0 && IsOfName(text, at - 1)) || !ends) continue;
    text.replace(at, kWritten.size(), word);
    if (is_capital) text[at] = absl::ascii_toupper(static_cast<unsigned char>(text[at]));
    at += word.size();
  }
  return text;
}

}  // namespace rigcal
