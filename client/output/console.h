// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <istream>
#include <ostream>
#include <streambuf>
#include <string>
#include <string_view>

namespace rigcal::client {

enum class OutputFormat { kTable, kJson };

// Where a command writes: results to `out`, everything else to `err`.
struct Console {
  std::ostream& out;
  std::ostream& err;
  bool err_is_terminal = false;
  // Where a person answers a question; null: nobody can be asked.
  std::istream* in = nullptr;
  // Grades on `out` are coloured: it is a terminal whose user does not refuse it (NO_COLOR).
  bool colour = false;
  OutputFormat format = OutputFormat::kTable;

  // A result for people on `out`.
  void Print(std::string_view text);

  // One line on `err`: "rigcal: <text>".
  void Message(std::string_view text);
};

// One line on a terminal that is written over and over; nothing where `err` is no terminal. The
// line is wiped when it is destroyed, and must be wiped (Clear) before a message.
class ProgressLine {
 public:
  explicit ProgressLine(Console& console) : console_(console) {}
  ~ProgressLine() { Clear(); }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  void Show(std::string_view text);
  void Clear();

 private:
  Console& console_;
  std::string shown_;
};

// Without control characters, so that a name or message from elsewhere cannot steer the terminal.
std::string Printable(std::string_view text);

// Writes to a file descriptor that it does not own. After a failed write everything further fails
// at once, and the error number is kept: a reader that went away (EPIPE) is no fault of ours.
class DescriptorBuffer : public std::streambuf {
 public:
  explicit DescriptorBuffer(int descriptor);
  ~DescriptorBuffer() override;

  // errno of the first failed write, 0 with none.
  int error_number() const { return error_number_; }

 protected:
  int_type overflow(int_type character) override;
  int sync() override;

 private:
  bool WriteAll();

  int descriptor_;
  int error_number_ = 0;
  std::array<char, 1 << 14> buffer_;
};

}  // namespace rigcal::client
