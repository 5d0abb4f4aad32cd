// SPDX-License-Identifier: Apache-2.0
#include "client/watch/terminal.h"

#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <string_view>

#include "absl/strings/str_cat.h"

namespace rigcal::client {
namespace {

constexpr char kEnter[] = "\x1b[?1049h\x1b[?25l\x1b[2J";
constexpr char kLeave[] = "\x1b[?25h\x1b[?1049l";
constexpr char kHome[] = "\x1b[H";
constexpr char kClearLine[] = "\x1b[K";
constexpr char kClearRest[] = "\x1b[J";

winsize SizeOf() {
  winsize size{};
  ioctl(STDOUT_FILENO, TIOCGWINSZ, &size);
  return size;
}

}  // namespace

bool Terminal::IsThere() {
  const char* const kind = std::getenv("TERM");
  return isatty(STDIN_FILENO) == 1 && isatty(STDOUT_FILENO) == 1 && kind != nullptr &&
         std::string_view(kind) != "dumb";
}

size_t Terminal::ColumnsOfOutput() { return SizeOf().ws_col; }

bool Terminal::HasColour() {
  const char* const kind = std::getenv("TERM");
  const char* const refused = std::getenv("NO_COLOR");
  return kind != nullptr && std::string_view(kind) != "dumb" &&
         (refused == nullptr || *refused == '\0');
}

Terminal::Terminal() {
  if (tcgetattr(STDIN_FILENO, &before_) == 0) {
    termios keys = before_;
    keys.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
    keys.c_cc[VMIN] = 0;
    keys.c_cc[VTIME] = 0;
    // Stopped or killed by these it could not restore anything.
    keys.c_cc[VSUSP] = _POSIX_VDISABLE;
    keys.c_cc[VQUIT] = _POSIX_VDISABLE;
    keys_ = tcsetattr(STDIN_FILENO, TCSANOW, &keys) == 0;
  }
  Write(kEnter);
}

Terminal::~Terminal() {
  Write(kLeave);
  if (keys_) tcsetattr(STDIN_FILENO, TCSANOW, &before_);
}

size_t Terminal::columns() const {
  const unsigned short columns = SizeOf().ws_col;
  return columns == 0 ? 80 : columns;
}

size_t Terminal::rows() const {
  const unsigned short rows = SizeOf().ws_row;
  return rows == 0 ? 24 : rows;
}

void Terminal::Show(const std::vector<std::string>& lines) {
  std::string text = kHome;
  for (size_t i = 0; i < lines.size(); ++i) {
    absl::StrAppend(&text, lines[i], kClearLine, i + 1 < lines.size() ? "\r\n" : "");
  }
  Write(absl::StrCat(text, kClearRest));
}

char Terminal::WaitForKey(std::chrono::milliseconds limit) {
  pollfd input{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
  if (poll(&input, 1, static_cast<int>(limit.count())) <= 0) return 0;
  char key = 0;
  if (read(STDIN_FILENO, &key, 1) == 1) return key;
  // The terminal is gone, or says that there is something where nothing is.
  poll(nullptr, 0, static_cast<int>(limit.count()));
  return 0;
}

void Terminal::Write(const std::string& text) {
  size_t written = 0;
  while (written < text.size()) {
    const ssize_t count = write(STDOUT_FILENO, text.data() + written, text.size() - written);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return;
    written += static_cast<size_t>(count);
  }
}

}  // namespace rigcal::client
