// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "common/options/option_table.h"

namespace rigcal {

// "log_level"
void AddLogLevel(std::string* level, OptionTable* table);
// "log_format"
void AddLogFormat(std::string* format, OptionTable* table);
// HOST:PORT with a port of `lowest_port` to 65535; unless that is 0, also unix:/PATH, and several
// with commas between.
void AddAddress(std::string name, std::string* address, int lowest_port, std::string meaning,
                OptionTable* table);
// As ValidateName.
void AddName(std::string name, std::string* value, std::string meaning, OptionTable* table);

// `path` relative to the folder of the configuration file.
std::string ResolvedPath(const std::string& config_path, const std::string& path);

}  // namespace rigcal
