// SPDX-License-Identifier: Apache-2.0
#include "client/output/console.h"

#include <unistd.h>

#include <cerrno>

#include "client/output/grade_colour.h"
#include "common/text/printable.h"

namespace rigcal::client {
namespace {

constexpr size_t kProgressColumns = 79;

}  // namespace

void Console::Print(std::string_view text) {
  out << (colour ? ColourGrades(text) : std::string(text)) << std::flush;
}

void Console::Message(std::string_view text) {
  out.flush();
  err << "rigcal: " << Printable(text) << "\n" << std::flush;
}

void ProgressLine::Show(std::string_view text) {
  if (!console_.err_is_terminal) return;
  std::string line = Printable(text.substr(0, text.find('\n')));
  if (line.size() > kProgressColumns) line.resize(kProgressColumns);
  if (line == shown_) return;
  // Erasing to the end of the line by spaces works on every terminal.
  const size_t rest = shown_.size() > line.size() ? shown_.size() - line.size() : 0;
  console_.err << "\r" << line << std::string(rest, ' ') << std::flush;
  shown_ = line;
}

void ProgressLine::Clear() {
  if (shown_.empty()) return;
  console_.err << "\r" << std::string(shown_.size(), ' ') << "\r" << std::flush;
  shown_.clear();
}

std::string Printable(std::string_view text) { return PrintableLines(text); }

DescriptorBuffer::DescriptorBuffer(int descriptor) : descriptor_(descriptor) {
  setp(buffer_.data(), buffer_.data() + buffer_.size());
}

DescriptorBuffer::~DescriptorBuffer() { WriteAll(); }

DescriptorBuffer::int_type DescriptorBuffer::overflow(int_type character) {
  if (!WriteAll()) return traits_type::eof();
  if (!traits_type::eq_int_type(character, traits_type::eof())) {
    *pptr() = traits_type::to_char_type(character);
    pbump(1);
  }
  return traits_type::not_eof(character);
}

int DescriptorBuffer::sync() { return WriteAll() ? 0 : -1; }

bool DescriptorBuffer::WriteAll() {
  const char* next = pbase();
  while (error_number_ == 0 && next < pptr()) {
    const ssize_t written = write(descriptor_, next, static_cast<size_t>(pptr() - next));
    if (written >= 0) {
      next += written;
    } else if (errno != EINTR) {
      error_number_ = errno;
    }
  }
  setp(buffer_.data(), buffer_.data() + buffer_.size());
  return error_number_ == 0;
}

}  // namespace rigcal::client
