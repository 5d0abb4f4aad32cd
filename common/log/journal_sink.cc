// SPDX-License-Identifier: Apache-2.0
#include "common/log/journal_sink.h"

#include <spdlog/sinks/base_sink.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <syslog.h>
#include <unistd.h>

#include <cstdlib>
#include <mutex>
#include <string_view>
#include <utility>

// The place in the source of this sink is not that of the entry.
#define SD_JOURNAL_SUPPRESS_LOCATION
#include <systemd/sd-journal.h>

#include "common/log/log_fields.h"
#include "common/text/printable.h"

namespace rigcal {
namespace {

constexpr char kSocket[] = "/run/systemd/journal/socket";

int PriorityOf(spdlog::level::level_enum level) {
  switch (level) {
    case spdlog::level::trace:
    case spdlog::level::debug:
      return LOG_DEBUG;
    case spdlog::level::info:
      return LOG_INFO;
    case spdlog::level::warn:
      return LOG_WARNING;
    case spdlog::level::err:
      return LOG_ERR;
    default:
      return LOG_CRIT;
  }
}

void WriteToJournal(const std::vector<std::string>& fields) {
  std::vector<iovec> parts;
  parts.reserve(fields.size());
  for (const std::string& field : fields) {
    parts.push_back({.iov_base = const_cast<char*>(field.data()), .iov_len = field.size()});
  }
  sd_journal_sendv(parts.data(), static_cast<int>(parts.size()));
}

class JournalSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  explicit JournalSink(JournalWriter write) : write_(std::move(write)) {}

 private:
  void sink_it_(const spdlog::details::log_msg& message) override {
    std::vector<std::string> fields;
    const auto add = [&fields](const char* name, std::string_view value) {
      if (!value.empty()) fields.push_back(name + Printable(value));
    };
    add("MESSAGE=", {message.payload.data(), message.payload.size()});
    add("PRIORITY=", std::to_string(PriorityOf(message.level)));
    add("SYSLOG_IDENTIFIER=", {message.logger_name.data(), message.logger_name.size()});
    const LogFields& about = LogFields::Current();
    add("RIGCAL_SESSION=", about.session);
    add("RIGCAL_CAMERA=", about.camera);
    add("RIGCAL_CALIBRATION=", about.calibration);
    add("RIGCAL_CORRELATION=", about.correlation);
    write_(fields);
  }
  void flush_() override {}

  const JournalWriter write_;
};

}  // namespace

std::shared_ptr<spdlog::sinks::sink> MakeJournalSink(JournalWriter write) {
  return std::make_shared<JournalSink>(write ? std::move(write) : WriteToJournal);
}

bool StderrIsJournal() {
  const char* const stream = std::getenv("JOURNAL_STREAM");
  struct stat file {};
  if (stream == nullptr || fstat(STDERR_FILENO, &file) != 0) return false;
  return std::to_string(file.st_dev) + ":" + std::to_string(file.st_ino) == stream;
}

bool HasJournal() {
  struct stat file {};
  return stat(kSocket, &file) == 0 && S_ISSOCK(file.st_mode);
}

}  // namespace rigcal
