// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>

namespace rigcal::agent {

// A line on stderr that counts what was read, written over and over; nothing where stderr is no
// terminal. It is wiped when it is destroyed.
class ReadingLine {
 public:
  ReadingLine();
  ~ReadingLine();
  ReadingLine(const ReadingLine&) = delete;
  ReadingLine& operator=(const ReadingLine&) = delete;

  void ShowEvents(uint64_t count);

 private:
  const bool is_terminal_;
  std::chrono::steady_clock::time_point shown_;
  bool is_shown_ = false;
};

}  // namespace rigcal::agent
