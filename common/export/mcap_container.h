// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace rigcal {

// What a topic of an MCAP file carries.
struct McapChannel {
  uint16_t schema = 0;  // which of the schemas, from 0
  std::string topic;
};

struct McapSchema {
  std::string name;  // "foxglove.CameraCalibration"
  std::string text;  // JSON schema
};

struct McapMessage {
  uint16_t channel = 0;  // which of the channels, from 0
  std::string json;
};

struct McapContent {
  std::vector<McapSchema> schemas;
  std::vector<McapChannel> channels;
  std::vector<McapMessage> messages;
  uint64_t time_ns = 0;  // of every message
};

// An MCAP file of JSON messages (mcap.dev, "MCAP Format Specification", version 0): one chunk
// without compression, its indexes, a summary, and every checksum.
std::string McapFile(const McapContent& content);

}  // namespace rigcal
