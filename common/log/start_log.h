// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/status.h"

namespace rigcal {

// Makes the log of a program: entries of level info and above as lines on stderr.
void StartLog(const std::string& program);

// How the log is written from now on; before other threads log. "text" and "json": lines on stderr
// (see common/log/log_formatters.h); "journal": entries with fields in systemd's journal; "auto":
// the journal where stderr goes there anyway, else text. FAILED_PRECONDITION: "journal", and this
// PC has none. INVALID_ARGUMENT: another word.
absl::Status SetLogFormat(const std::string& format);

// The word that SetLogFormat was given last; "text" before.
std::string LogFormat();

// trace, debug, info, warn, error or off; INVALID_ARGUMENT: another word.
absl::Status SetLogLevel(const std::string& level);
// The level in use, as SetLogLevel takes it.
std::string LogLevel();

}  // namespace rigcal
