// SPDX-License-Identifier: Apache-2.0
#include "common/log/start_log.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/log/journal_sink.h"
#include "common/log/log_formatters.h"

namespace rigcal {
namespace {

void Use(const std::string& program, std::shared_ptr<spdlog::sinks::sink> sink) {
  auto logger = std::make_shared<spdlog::logger>(program, std::move(sink));
  logger->set_level(spdlog::get_level());
  spdlog::set_default_logger(std::move(logger));
}

// Written before other threads log.
std::string& FormatInUse() {
  static std::string format = "text";
  return format;
}

std::shared_ptr<spdlog::sinks::sink> TextSink() {
  auto sink = std::make_shared<spdlog::sinks::stderr_color_sink_mt>();
  sink->set_formatter(MakeTextFormatter());
  return sink;
}

std::shared_ptr<spdlog::sinks::sink> JsonSink() {
  auto sink = std::make_shared<spdlog::sinks::stderr_sink_mt>();
  sink->set_formatter(MakeJsonFormatter());
  return sink;
}

}  // namespace

void StartLog(const std::string& program) { Use(program, TextSink()); }

absl::Status SetLogFormat(const std::string& format) {
  const std::string program = spdlog::default_logger()->name();
  if (format == "text" || (format == "auto" && !(StderrIsJournal() && HasJournal()))) {
    Use(program, TextSink());
  } else if (format == "json") {
    Use(program, JsonSink());
  } else if (format != "journal" && format != "auto") {
    return absl::InvalidArgumentError(
        absl::StrCat("the log format '", format, "' is none of auto, text, json, journal"));
  } else if (!HasJournal()) {
    return absl::FailedPreconditionError(
        "log format journal: there is no journal of systemd here (/run/systemd/journal/socket); "
        "use text or json");
  } else {
    Use(program, MakeJournalSink());
  }
  FormatInUse() = format;
  return absl::OkStatus();
}

std::string LogFormat() { return FormatInUse(); }

absl::Status SetLogLevel(const std::string& level) {
  for (const char* known : {"trace", "debug", "info", "warn", "error", "off"}) {
    if (level != known) continue;
    spdlog::set_level(spdlog::level::from_str(level));
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("the log level '", level, "' is none of trace, debug, info, warn, error, off"));
}

std::string LogLevel() {
  const spdlog::level::level_enum level = spdlog::get_level();
  if (level == spdlog::level::warn) return "warn";
  if (level == spdlog::level::critical) return "error";
  return spdlog::level::to_string_view(level).data();
}

}  // namespace rigcal
