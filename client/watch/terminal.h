// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <termios.h>

#include <chrono>
#include <cstddef>
#include <string>
#include <vector>

namespace rigcal::client {

// The terminal of stdin and stdout while something is shown on all of it: its other screen, without
// cursor, and keys without Enter. Everything is as before once it is destroyed. One at a time.
class Terminal {
 public:
  // True: both are a terminal that can do this.
  static bool IsThere();
  // Columns of the terminal of stdout; 0: not known.
  static size_t ColumnsOfOutput();
  // Whether it shows colours that its user wants (no-color.org).
  static bool HasColour();

  Terminal();
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  size_t columns() const;
  size_t rows() const;
  // Writes these lines over what is there.
  void Show(const std::vector<std::string>& lines);
  // A key that is pressed meanwhile; 0: none, or a signal has come.
  char WaitForKey(std::chrono::milliseconds limit);

 private:
  void Write(const std::string& text);

  termios before_{};
  bool keys_ = false;  // before_ is to be restored
};

}  // namespace rigcal::client
