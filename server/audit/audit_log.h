// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace rigcal::server {

struct AuditLogOptions {
  // A file that has grown so far becomes FILE.1, and FILE.1 becomes FILE.2, up to `kept_files`.
  uint64_t max_file_bytes = uint64_t{8} << 20;
  int kept_files = 4;
  // Lines of one kind about one peer in an interval; more are counted in the first line after it,
  // so that nobody washes out the lines of others.
  int max_lines_per_interval = 20;
  std::chrono::milliseconds interval{10'000};
  std::function<int64_t()> utc_now_ns = {};  // unset: the system's clock
};

// Who did what, and who was refused: one JSON object a line, mode 0600. A line that cannot be
// written is logged as an error, once, and counted. Thread-safe.
class AuditLog {
 public:
  using Fields = std::vector<std::pair<std::string_view, std::string>>;

  // Empty `file`: nothing is written.
  explicit AuditLog(std::filesystem::path file, AuditLogOptions options = {});
  ~AuditLog();
  AuditLog(const AuditLog&) = delete;
  AuditLog& operator=(const AuditLog&) = delete;

  // {"time":"2026-01-02T03:04:05.678Z","event":EVENT,"peer":PEER,...}. Texts are cut at 1 KiB; what
  // is not UTF-8 is replaced.
  void Write(std::string_view event, std::string_view peer, const Fields& fields = {});
  // The same for what somebody was allowed to change: none of these lines is left out.
  void WriteChange(std::string_view event, std::string_view peer, const Fields& fields = {});

 private:
  struct Recent {
    std::chrono::steady_clock::time_point begin;
    int lines = 0;
    uint64_t left_out = 0;
  };

  void WriteLine(std::string_view event, std::string_view peer, const Fields& fields, bool always);
  // False: this line is one too many. `left_out`: how many were before it.
  bool MayWrite(std::string_view event, std::string_view peer, uint64_t* left_out);
  void Append(const std::string& line);
  void Open();
  void Rotate();

  const std::filesystem::path file_;
  const AuditLogOptions options_;
  std::mutex mutex_;
  int descriptor_ = -1;
  uint64_t bytes_ = 0;
  bool failed_ = false;
  std::map<std::string, Recent> recent_;
};

}  // namespace rigcal::server
