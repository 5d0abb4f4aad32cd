// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "agent/event_files/event_file.h"

namespace rigcal::agent {

// Opens a RAW file of an event camera. Holds one block of it in memory.
//
// `options`: the order of the words of EVT 2.1.
//
// NOT_FOUND, PERMISSION_DENIED: no such file, or it cannot be read. INVALID_ARGUMENT: the header
// (ParseRawHeader). Each names the file.
absl::StatusOr<std::unique_ptr<EventFile>> OpenRawEvents(const std::string& path,
                                                         const EventFileOptions& options = {});

}  // namespace rigcal::agent
