// SPDX-License-Identifier: Apache-2.0
#include "client/output/console.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <sstream>
#include <string>

namespace rigcal::client::console_test {
namespace {

TEST(DescriptorBuffer, WritesEverythingInOrder) {
  int pipe_ends[2];
  ASSERT_EQ(pipe(pipe_ends), 0);
  std::string expected;
  {
    DescriptorBuffer buffer(pipe_ends[1]);
    std::ostream out(&buffer);
    // More than its buffer, less than a pipe's.
    for (int i = 0; i < 5000; ++i) {
      out << i << "\n";
      expected += std::to_string(i) + "\n";
    }
    EXPECT_EQ(buffer.error_number(), 0);
  }
  close(pipe_ends[1]);
  std::string got;
  char piece[4096];
  for (ssize_t n = 0; (n = read(pipe_ends[0], piece, sizeof(piece))) > 0;) {
    got.append(piece, static_cast<size_t>(n));
  }
  close(pipe_ends[0]);
  EXPECT_EQ(got, expected);
}

TEST(DescriptorBuffer, KeepsTheErrorOfAReaderThatWentAway) {
  int pipe_ends[2];
  ASSERT_EQ(pipe(pipe_ends), 0);
  close(pipe_ends[0]);
  const auto before = signal(SIGPIPE, SIG_IGN);
  DescriptorBuffer buffer(pipe_ends[1]);
  std::ostream out(&buffer);
  out << "text" << std::flush;
  EXPECT_FALSE(out.good());
  EXPECT_EQ(buffer.error_number(), EPIPE);
  signal(SIGPIPE, before);
  close(pipe_ends[1]);
}

TEST(DescriptorBuffer, KeepsTheErrorOfAFullDisk) {
  const int full = open("/dev/full", O_WRONLY | O_CLOEXEC);
  ASSERT_GE(full, 0);
  DescriptorBuffer buffer(full);
  std::ostream out(&buffer);
  out << std::string(100'000, 'x') << std::flush;
  EXPECT_FALSE(out.good());
  EXPECT_EQ(buffer.error_number(), ENOSPC);
  close(full);
}

TEST(ProgressLine, IsSilentWhereNobodyLooks) {
  std::ostringstream out, err;
  Console console{.out = out, .err = err};
  ProgressLine progress(console);
  progress.Show("capturing");
  progress.Clear();
  EXPECT_EQ(err.str(), "");
}

TEST(ProgressLine, WritesOverItselfAndWipesItself) {
  std::ostringstream out, err;
  Console console{.out = out, .err = err, .err_is_terminal = true};
  {
    ProgressLine progress(console);
    progress.Show("capturing");
    progress.Show("done");
    progress.Show("done");
  }
  EXPECT_EQ(err.str(), "\rcapturing\rdone     \r    \r");
  EXPECT_EQ(out.str(), "");
}

TEST(ProgressLine, StaysInOneLineOfTheTerminal) {
  std::ostringstream out, err;
  Console console{.out = out, .err = err, .err_is_terminal = true};
  ProgressLine progress(console);
  progress.Show(std::string(300, 'x') + "\nmore");
  EXPECT_EQ(err.str(), "\r" + std::string(79, 'x'));
}

TEST(Message, GoesToStderrWithoutControlCharacters) {
  std::ostringstream out, err;
  Console console{.out = out, .err = err};
  console.Message("no session \x1b]0;x\x07 here\nsecond line");
  EXPECT_EQ(err.str(), "rigcal: no session \\x1b]0;x\\x07 here\nsecond line\n");
  EXPECT_EQ(out.str(), "");
}

}  // namespace
}  // namespace rigcal::client::console_test
