// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "agent/event_files/plain_event_reader.h"

namespace rigcal::agent {

// Opens a text file with one event on each line: x,y,p,t, separated by comma, semicolon, tab or
// blank. A header line names the columns in any order; without one their order is options.columns.
// Lines that begin with '#' or '%' are comments, in which "geometry: 640,480" (or 640x480) is the
// sensor's size, as is a first line of two numbers. p: 0/1, -1/1 or false/true; t: see TimeUnit.
//
// Bad lines are left out and counted as event_csv_bad_line; a file of which more than a thousand
// and more than half of the lines so far are bad is not read on: DATA_LOSS.
//
// NOT_FOUND, PERMISSION_DENIED, FAILED_PRECONDITION: no file that can be opened. INVALID_ARGUMENT:
// its first lines are not events; names the file, the line and what a line looks like.
absl::StatusOr<std::unique_ptr<PlainEventReader>> OpenCsvEvents(const std::string& path,
                                                                const EventFileOptions& options);

}  // namespace rigcal::agent
