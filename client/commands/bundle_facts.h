// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "client/net/server_connection.h"
#include "common/export/archive.h"

namespace rigcal::client {

// What `rigcal doctor --bundle` puts together besides its own report. None has observations. What
// cannot be read is a file that says why not.

// Versions of rigcal's programs, the system and the libraries; free space of disks.
ExportFile VersionsOfThisPc();
ExportFile DisksOfThisPc();
// The last lines of the services' log in systemd's journal.
ExportFile LastLogLines();
// Each file as it is on the disk; those in /etc/rigcal where `files` is empty.
std::vector<ExportFile> Configurations(const std::vector<std::string>& files);
// What the server says of itself, its agents, sessions and last calibrations (quality and findings,
// not their cameras), and its metrics where its page is at the usual port of this PC.
std::vector<ExportFile> StateOfServer(ServerConnection& server);

}  // namespace rigcal::client
