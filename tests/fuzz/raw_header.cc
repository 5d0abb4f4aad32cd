// SPDX-License-Identifier: Apache-2.0
// The header of a RAW file: what it tells must be true of the bytes, and a fault must name one of
// them.
#include "agent/event_files/raw_header.h"

#include <algorithm>
#include <string>
#include <vector>

#include "tests/fuzz/fuzz_check.h"

using ::rigcal::agent::EventFormat;
using ::rigcal::agent::ParseRawHeader;
using ::rigcal::agent::EventFileHeader;

namespace {

constexpr size_t kHeaderBytes = 64 * 1024;

void CheckHeader(const EventFileHeader& header, std::span<const uint8_t> bytes) {
  FUZZ_CHECK(header.byte_count > 0);
  FUZZ_CHECK(header.byte_count <= std::min(bytes.size(), kHeaderBytes));
  // The events begin after the end of a line.
  FUZZ_CHECK(bytes[header.byte_count - 1] == '\n');
  FUZZ_CHECK(bytes[0] == '%');
  FUZZ_CHECK(header.format == EventFormat::kEvt2 || header.format == EventFormat::kEvt21 ||
             header.format == EventFormat::kEvt3);
  FUZZ_CHECK(!header.fields.empty());
  if (header.geometry) {
    FUZZ_CHECK(header.geometry->width >= 1 && header.geometry->width <= 2048);
    FUZZ_CHECK(header.geometry->height >= 1 && header.geometry->height <= 2048);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::span<const uint8_t> bytes(data, size);
  const auto header = ParseRawHeader(bytes);
  if (!header.ok()) {
    FUZZ_CHECK(header.status().code() == absl::StatusCode::kInvalidArgument);
    const std::string message(header.status().message());
    FUZZ_CHECK(message.find(", byte ") != std::string::npos);
    FUZZ_CHECK(message.size() < size + 300);
    return 0;
  }
  CheckHeader(*header, bytes);
  // The header alone gives the same result, unless the events after it look like another line.
  const auto alone = ParseRawHeader(bytes.first(header->byte_count));
  FUZZ_CHECK(alone.ok());
  FUZZ_CHECK(alone->byte_count == header->byte_count);
  FUZZ_CHECK(alone->format == header->format && alone->geometry == header->geometry);
  FUZZ_CHECK(alone->halves_swapped == header->halves_swapped && alone->fields == header->fields);
  return 0;
}
