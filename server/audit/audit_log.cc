// SPDX-License-Identifier: Apache-2.0
#include "server/audit/audit_log.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <nlohmann/json.hpp>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxTextBytes = 1024;
constexpr size_t kMaxRecent = 1024;

std::string Cut(std::string_view text) {
  if (text.size() <= kMaxTextBytes) return std::string(text);
  return absl::StrCat(std::string(text.substr(0, kMaxTextBytes)), "...");
}

}  // namespace

AuditLog::AuditLog(std::filesystem::path file, AuditLogOptions options)
    : file_(std::move(file)), options_(std::move(options)) {
  std::lock_guard lock(mutex_);
  if (!file_.empty()) Open();
}

AuditLog::~AuditLog() {
  if (descriptor_ >= 0) close(descriptor_);
}

void AuditLog::Write(std::string_view event, std::string_view peer, const Fields& fields) {
  WriteLine(event, peer, fields, /*always=*/false);
}

void AuditLog::WriteChange(std::string_view event, std::string_view peer, const Fields& fields) {
  WriteLine(event, peer, fields, /*always=*/true);
}

void AuditLog::WriteLine(std::string_view event, std::string_view peer, const Fields& fields,
                         bool always) {
  if (file_.empty()) return;
  const absl::Time now =
      options_.utc_now_ns ? absl::FromUnixNanos(options_.utc_now_ns()) : absl::Now();
  nlohmann::ordered_json line = {
      {"time", absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", now, absl::UTCTimeZone())},
      {"event", Cut(event)},
      {"peer", Cut(peer)}};
  for (const auto& [name, value] : fields) line[std::string(name)] = Cut(value);
  std::lock_guard lock(mutex_);
  uint64_t left_out = 0;
  if (!always && !MayWrite(event, peer, &left_out)) return;
  if (left_out > 0) line["left_out"] = left_out;
  // ASCII only: a terminal that shows the file takes no orders from it.
  Append(line.dump(-1, ' ', /*ensure_ascii=*/true, nlohmann::json::error_handler_t::replace) +
         "\n");
}

bool AuditLog::MayWrite(std::string_view event, std::string_view peer, uint64_t* left_out) {
  const auto now = std::chrono::steady_clock::now();
  if (recent_.size() >= kMaxRecent) {
    std::erase_if(recent_, [&](const auto& item) {
      return now - item.second.begin >= options_.interval && item.second.left_out == 0;
    });
    // A flood under ever new names: they share one place.
    if (recent_.size() >= kMaxRecent) peer = "";
  }
  Recent& recent = recent_[absl::StrCat(std::string(event), "\n", Cut(peer))];
  if (recent.lines == 0 || now - recent.begin >= options_.interval) {
    *left_out = recent.left_out;
    recent = {.begin = now};
  }
  if (++recent.lines <= options_.max_lines_per_interval) return true;
  ++recent.left_out;
  return false;
}

void AuditLog::Open() {
  descriptor_ = open(file_.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  struct stat status {};
  bytes_ = descriptor_ >= 0 && fstat(descriptor_, &status) == 0
               ? static_cast<uint64_t>(status.st_size)
               : 0;
}

void AuditLog::Rotate() {
  close(descriptor_);
  const auto numbered = [this](int i) { return absl::StrCat(file_.string(), ".", i); };
  std::error_code ignored;
  for (int i = options_.kept_files - 1; i >= 1; --i) {
    std::filesystem::rename(numbered(i), numbered(i + 1), ignored);
  }
  std::filesystem::rename(file_, numbered(1), ignored);
  Open();
}

void AuditLog::Append(const std::string& line) {
  if (descriptor_ >= 0 && bytes_ > 0 && bytes_ + line.size() > options_.max_file_bytes) Rotate();
  if (descriptor_ < 0) Open();
  const ssize_t written = descriptor_ < 0 ? -1 : write(descriptor_, line.data(), line.size());
  if (written == static_cast<ssize_t>(line.size())) {
    bytes_ += line.size();
    failed_ = false;
    return;
  }
  if (!std::exchange(failed_, true)) {
    spdlog::error("cannot write to the audit log {}: {}", file_.string(), std::strerror(errno));
  }
}

}  // namespace rigcal::server
