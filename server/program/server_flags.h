// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/config/server_config.h"

namespace rigcal::server {

// The command line of rigcal-server. What is empty or false is as the configuration has it.
struct ServerFlags {
  std::string config_file;
  std::string port_file;
  std::string http_port_file;
  // These override the file.
  std::string listen;
  std::string advertise;
  std::string data_dir;
  std::string store;
  bool store_unsafe = false;
  bool no_solve = false;
  std::string docs_dir;
  std::string follow;
  std::string log_level;
  std::string log_format;
};

void AddServerFlags(CLI::App* app, ServerFlags* flags);

// INVALID_ARGUMENT: --listen or --advertise is no address; the message names the option.
absl::Status CheckAddresses(const ServerFlags& flags);

// The configuration file, if there is one, with the flags over it. Errors: those of
// ReadServerConfig; INVALID_ARGUMENT: options that do not go together.
absl::StatusOr<ServerConfig> ReadConfig(const ServerFlags& flags);

}  // namespace rigcal::server
