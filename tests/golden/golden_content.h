// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "absl/status/status.h"
#include "agent/spool/observation_spool.h"
#include "server/store/store.h"

namespace rigcal::testing {

// What the files of tests/golden/protocol_* were made from. It must not change: a release that
// reads its own files only is what they are for.

// Messages by name: "hello", "batch", "report", "end", "server_hello", "start", "ack".
std::map<std::string, std::string> GoldenMessages();

// Two sessions, one of them calibrated, into an empty store.
absl::Status FillGoldenStore(server::Store* store);

// Two streams, of which one has ended and one is partly acknowledged, into an empty spool.
absl::Status FillGoldenSpool(agent::ObservationSpool* spool);

}  // namespace rigcal::testing
