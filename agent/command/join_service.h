// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"

namespace rigcal::agent {

// The agent of the package: rigcal-agent.service, its user, its configuration.
inline constexpr char kServiceName[] = "rigcal-agent";
inline constexpr char kServiceConfig[] = "/etc/rigcal/agent.toml";

// Whether root joins for the service: this is root, and the package is installed.
bool JoinsForService();

// Runs `rigcal-agent join ARGUMENTS` as the service's user with its configuration, while the
// service is stopped, and starts it. FAILED_PRECONDITION: one of these steps failed; the step has
// said why.
absl::Status JoinForService(const std::vector<std::string>& arguments);

}  // namespace rigcal::agent
