// SPDX-License-Identifier: Apache-2.0
#include "common/text/printable.h"

#include <cstdint>
#include <cstdio>

#include "common/text/utf8.h"

namespace rigcal {
namespace {

// Controls, also those of Latin 1; marks, embeddings, overrides and isolates of direction; line and
// paragraph separators; invisible ones that hide what follows.
bool IsUnprintable(uint32_t character) {
  return character < 0x20 || (character >= 0x7f && character < 0xa0) || character == 0x061c ||
         (character >= 0x200b && character <= 0x200f) ||
         (character >= 0x2028 && character <= 0x202e) ||
         (character >= 0x2060 && character <= 0x206f) || character == 0xfeff ||
         (character >= 0xfff9 && character <= 0xfffb) ||
         (character >= 0xe0000 && character <= 0xe0fff);
}

// Bytes of the character that begins with this byte; 1 for none.
size_t Length(unsigned char lead) {
  return lead < 0xc0 ? 1 : lead < 0xe0 ? 2 : lead < 0xf0 ? 3 : 4;
}

uint32_t Decode(std::string_view character) {
  if (character.size() == 1) return static_cast<unsigned char>(character[0]);
  uint32_t value = static_cast<unsigned char>(character[0]) & (0x7fu >> character.size());
  for (const char c : character.substr(1)) value = value << 6 | (static_cast<uint8_t>(c) & 0x3fu);
  return value;
}

void Escape(uint32_t character, std::string* out) {
  switch (character) {
    case '\n':
      *out += "\\n";
      return;
    case '\r':
      *out += "\\r";
      return;
    case '\t':
      *out += "\\t";
      return;
    default:
      break;
  }
  char buffer[16];
  const char* const format = character < 0x100     ? "\\x%02x"
                             : character < 0x10000 ? "\\u%04x"
                                                   : "\\U%08x";
  std::snprintf(buffer, sizeof(buffer), format, character);
  *out += buffer;
}

std::string EscapeAll(std::string_view text, bool keep_newlines) {
  std::string out;
  out.reserve(text.size());
  for (size_t i = 0; i < text.size();) {
    std::string_view character = text.substr(i, Length(static_cast<unsigned char>(text[i])));
    if (!IsUtf8(character)) {
      Escape(static_cast<unsigned char>(text[i]), &out);
      ++i;
      continue;
    }
    const uint32_t value = Decode(character);
    if (IsUnprintable(value) && !(keep_newlines && value == '\n')) {
      Escape(value, &out);
    } else {
      out += character;
    }
    i += character.size();
  }
  return out;
}

}  // namespace

std::string Printable(std::string_view text) { return EscapeAll(text, false); }
std::string PrintableLines(std::string_view text) { return EscapeAll(text, true); }

std::string_view Beginning(std::string_view text, size_t bytes) {
  if (text.size() <= bytes) return text;
  while (bytes > 0 && (static_cast<unsigned char>(text[bytes]) & 0xc0) == 0x80) --bytes;
  return text.substr(0, bytes);
}

}  // namespace rigcal
