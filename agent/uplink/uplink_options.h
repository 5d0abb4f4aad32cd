// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>

#include "agent/capture/preview/preview_worker.h"

namespace rigcal::agent {

struct UplinkOptions {
  std::string server;  // its address, for messages
  std::string agent_id;
  uint32_t incarnation = 1;  // grows at each start of the agent
  // Of new streams. The incarnation as long as the spool is in memory: observations that a run has
  // not delivered are lost with it, so the next run must not continue its numbers.
  uint32_t stream_epoch = 1;
  std::string host;  // of this PC, for people
  std::string rig = "rig";

  // Rows of a full batch, and how long fewer rows wait to become one. The server may ask for fewer.
  size_t max_batch_rows = 256;
  std::chrono::milliseconds flush_interval{20};
  std::chrono::milliseconds ping_interval{10'000};
  std::chrono::milliseconds report_interval{2'000};
  // A connection is given up when the server sends no hello, or nothing at all, for so long.
  std::chrono::milliseconds hello_timeout{10'000};
  std::chrono::milliseconds silence_timeout{60'000};
  // How long observations wait for the first answer to a ping, where their clock needs one.
  std::chrono::milliseconds alignment_timeout{1'000};
  // Between attempts: from lowest to highest with full jitter. After an error that only a person
  // can end (versions, a camera that another agent holds), always refused_wait.
  std::chrono::milliseconds lowest_wait{200};
  std::chrono::milliseconds highest_wait{30'000};
  std::chrono::milliseconds refused_wait{30'000};

  PreviewOptions previews;
};

}  // namespace rigcal::agent
