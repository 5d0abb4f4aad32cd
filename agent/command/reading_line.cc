// SPDX-License-Identifier: Apache-2.0
#include "agent/command/reading_line.h"

#include <unistd.h>

#include <cstdio>

namespace rigcal::agent {
namespace {

constexpr std::chrono::milliseconds kShowEvery{500};

}  // namespace

ReadingLine::ReadingLine()
    : is_terminal_(isatty(STDERR_FILENO) == 1), shown_(std::chrono::steady_clock::now()) {}

ReadingLine::~ReadingLine() {
  if (is_shown_) std::fprintf(stderr, "\r%40s\r", "");
}

void ReadingLine::ShowEvents(uint64_t count) {
  const auto now = std::chrono::steady_clock::now();
  if (!is_terminal_ || now - shown_ < kShowEvery) return;
  shown_ = now;
  is_shown_ = true;
  std::fprintf(stderr, "\r%.1f million events read", static_cast<double>(count) / 1e6);
  std::fflush(stderr);
}

}  // namespace rigcal::agent
