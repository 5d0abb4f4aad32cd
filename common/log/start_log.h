// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <spdlog/common.h>

#include <memory>
#include <string>

namespace spdlog {
class formatter;
}

namespace rigcal {

// Makes the log of a program: lines on stderr with time, program and level. Texts from elsewhere
// (names, paths, errors of peers) cannot forge lines or move the cursor: see Printable.
void StartLog(const std::string& program);

// What formats its lines.
std::unique_ptr<spdlog::formatter> MakeLogFormatter();

}  // namespace rigcal
