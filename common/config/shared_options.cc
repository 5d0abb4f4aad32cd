// SPDX-License-Identifier: Apache-2.0
#include "common/config/shared_options.h"

#include <filesystem>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"

namespace rigcal {

void AddLogLevel(std::string* level, OptionTable* table) {
  std::vector<std::pair<std::string, std::string>> levels;
  for (const char* name : {"trace", "debug", "info", "warn", "error", "off"}) {
    levels.emplace_back(name, name);
  }
  table->AddChoice("log_level", level, std::move(levels), "what is logged");
}

void AddLogFormat(std::string* format, OptionTable* table) {
  std::vector<std::pair<std::string, std::string>> formats;
  for (const char* name : {"auto", "text", "json", "journal"}) formats.emplace_back(name, name);
  table->AddChoice("log_format", format, std::move(formats), "how the log is written");
}

namespace {

absl::Status CheckAddress(const std::string& text, int lowest_port) {
  // A client may name the socket file of a server on this machine.
  if (lowest_port > 0 && text.starts_with("unix:/")) return absl::OkStatus();
  const size_t colon = text.rfind(':');
  int port = -1;
  if (colon == std::string::npos || colon == 0 ||
      !absl::SimpleAtoi(text.substr(colon + 1), &port) || port < lowest_port || port > 65535) {
    return absl::InvalidArgumentError("must be HOST:PORT, such as 127.0.0.1:7420");
  }
  return absl::OkStatus();
}

}  // namespace

void AddAddress(std::string name, std::string* address, int lowest_port, std::string meaning,
                OptionTable* table) {
  const auto read = [address, lowest_port](const std::string& text) {
    const char separator = lowest_port > 0 ? ',' : '\0';
    for (const absl::string_view part : absl::StrSplit(text, separator)) {
      RIGCAL_RETURN_IF_ERROR(
          CheckAddress(std::string(absl::StripAsciiWhitespace(part)), lowest_port));
    }
    *address = text;
    return absl::OkStatus();
  };
  table->Add(std::move(name), "HOST:PORT", std::move(meaning), read, [=] { return *address; });
}

void AddName(std::string name, std::string* value, std::string meaning, OptionTable* table) {
  const auto read = [value](const std::string& text) {
    if (!ValidateName("", text).ok()) {
      return absl::InvalidArgumentError(
          "must be 1 to 64 letters, digits, '_', '-' or '.', not beginning with '.'");
    }
    *value = text;
    return absl::OkStatus();
  };
  table->Add(std::move(name), "NAME", std::move(meaning), read, [=] { return *value; });
}

std::string ResolvedPath(const std::string& config_path, const std::string& path) {
  if (path.empty()) return path;
  const auto folder = std::filesystem::path(config_path).parent_path();
  return (folder / path).lexically_normal().string();
}

}  // namespace rigcal
