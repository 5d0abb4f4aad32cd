// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <spdlog/sinks/sink.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace rigcal {

// Takes the fields of one entry, "NAME=value" each.
using JournalWriter = std::function<void(const std::vector<std::string>& fields)>;

// Writes entries to systemd's journal with the fields MESSAGE, PRIORITY (of syslog(3)),
// SYSLOG_IDENTIFIER (the program), and of LogFields those that are known: RIGCAL_SESSION,
// RIGCAL_CAMERA, RIGCAL_CALIBRATION, RIGCAL_CORRELATION. No value has a line break: see Printable.
// `write` is for tests; unset, entries go to sd_journal_sendv(3).
std::shared_ptr<spdlog::sinks::sink> MakeJournalSink(JournalWriter write = {});

// Standard error goes to the journal: $JOURNAL_STREAM has its device and inode, as systemd.exec(5)
// says.
bool StderrIsJournal();

// The journal takes entries: without its socket sd_journal_sendv drops them without a word.
bool HasJournal();

}  // namespace rigcal
