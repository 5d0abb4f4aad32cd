// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace rigcal::server {

// Where a database is, and as whom to open it. Holds the password and never shows it.
class PostgresAddress {
 public:
  // postgresql://[USER[:PASSWORD]@]HOST[:PORT][,HOST2...]/DATABASE[?OPTION=VALUE], as libpq reads
  // it
  // ("Connection URIs" in PostgreSQL's manual). What is not in it comes from libpq's environment
  // (PGPASSWORD, PGPASSFILE, ~/.pgpass, ...). INVALID_ARGUMENT: it cannot be read; the message does
  // not repeat it.
  static absl::StatusOr<PostgresAddress> Parse(const std::string& url);
  // The text is an address of this kind.
  static bool Is(std::string_view location);

  // What libpq gets, with what rigcal adds: time limits, and that of several hosts the one is taken
  // that can be written.
  const std::map<std::string, std::string>& options() const { return options_; }
  PostgresAddress With(const std::string& option, const std::string& value) const;
  // For messages, without password: "postgresql://rigcal@db1:5432/rigcal".
  const std::string& text() const { return text_; }

 private:
  std::map<std::string, std::string> options_;
  std::string text_;
};

}  // namespace rigcal::server
