// SPDX-License-Identifier: Apache-2.0
// A checkpoint of the agent's spool. With an odd first byte the rest is its body, and gets the
// prefix with a good checksum.
#include <spdlog/spdlog.h>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "agent/spool/disk/byte_format.h"
#include "agent/spool/disk/checkpoint.h"
#include "agent/spool/disk/disk_spool.h"
#include "tests/agent/spool/disk/model_file_system.h"
#include "tests/fuzz/fuzz_check.h"

using rigcal::agent::DecodeCheckpoint;
using rigcal::agent::DiskSpool;
using rigcal::agent::DiskSpoolOptions;
using rigcal::agent::EncodeCheckpoint;
using rigcal::agent::ModelFileSystem;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const bool kQuiet = (spdlog::set_level(spdlog::level::off), true);
  FUZZ_CHECK(kQuiet);
  if (size == 0) return 0;
  const std::string_view rest(reinterpret_cast<const char*>(data) + 1, size - 1);
  std::string bytes;
  if (data[0] % 2 != 0) {
    bytes = "RCCHECK1";
    rigcal::agent::PutNumber(static_cast<uint32_t>(rest.size()), &bytes);
    rigcal::agent::PutNumber(rigcal::agent::SpoolChecksum(rest), &bytes);
  }
  bytes += rest;
  if (const auto checkpoint = DecodeCheckpoint(bytes)) {
    const std::string again = EncodeCheckpoint(*checkpoint);
    const auto back = DecodeCheckpoint(again);
    FUZZ_CHECK(back && EncodeCheckpoint(*back) == again);
  }
  ModelFileSystem files;
  files.SetContent("checkpoint", bytes);
  DiskSpoolOptions options;
  options.folder = "/model";
  options.has_thread = false;
  const auto spool = DiskSpool::Create(options, &files);
  FUZZ_CHECK(spool.ok());
  for (const auto& stream : (*spool)->Streams()) {
    FUZZ_CHECK(stream.end && stream.end->last_seq == stream.end_seq - 1);
    FUZZ_CHECK(stream.row_count == 0);
    uint32_t next = stream.durable_seq + 1;
    for (int reads = 0; next < stream.end_seq; ++reads) {
      FUZZ_CHECK(reads < 100'000);
      const auto batch = (*spool)->Read(stream.stream, next, 100);
      FUZZ_CHECK(batch.ok() && batch->rows() == 0 && !batch->dropped.empty());
      next = batch->first_seq;
    }
  }
  return 0;
}
