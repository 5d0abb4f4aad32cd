// SPDX-License-Identifier: Apache-2.0
// A segment of the agent's spool, as a disk gives it back. The first byte chooses: bit 0, the bytes
// behind it follow a good header; bit 1, they are records to be written with good checksums (number
// and size, then the payload); bit 2, there is another segment behind it.
#include <spdlog/spdlog.h>

#include <cstdint>
#include <memory>
#include <string>

#include "agent/spool/disk/byte_format.h"
#include "agent/spool/disk/disk_spool.h"
#include "agent/spool/disk/segment_format.h"
#include "tests/agent/spool/disk/model_file_system.h"
#include "tests/fuzz/fuzz_check.h"
#include "tests/fuzz/fuzz_input.h"

using rigcal::DroppedRange;
using rigcal::ObservationBatch;
using rigcal::StreamKey;
using rigcal::agent::DiskSpool;
using rigcal::agent::DiskSpoolOptions;
using rigcal::agent::ModelFileSystem;

namespace {

constexpr char kFirst[] = "0000000001-000001-0000000001.seg";
constexpr char kSecond[] = "0000000002-000001-0000000041.seg";

std::string Header(uint32_t first_seq) {
  return rigcal::agent::EncodeHeader({.stream_number = 1,
                                      .stream = {"s-1", "left", 5},
                                      .marker_count = 2,
                                      .begin_seq = 1,
                                      .first_seq = first_seq,
                                      .boot = 1});
}

// A record with this number and payload, whatever they are.
std::string Record(uint32_t seq, std::string_view payload) {
  std::string checked;
  rigcal::agent::PutNumber(seq, &checked);
  checked += payload;
  std::string bytes = "\xa5RC1";
  rigcal::agent::PutNumber(static_cast<uint32_t>(payload.size()), &bytes);
  rigcal::agent::PutNumber(rigcal::agent::SpoolChecksum(checked), &bytes);
  return bytes + checked;
}

std::string Content(int mode, rigcal::testing::FuzzInput input) {
  std::string content;
  if ((mode & 1) != 0) content = Header(1);
  if ((mode & 2) == 0) {
    return content.append(reinterpret_cast<const char*>(input.rest().data()), input.rest().size());
  }
  while (!input.empty()) {
    const uint32_t seq = input.Word16();
    std::string payload(input.Byte(), '\0');
    for (char& byte : payload) byte = static_cast<char>(input.Byte());
    content += Record(seq, payload);
  }
  return content;
}

void CheckStream(DiskSpool& spool, const StreamKey& key) {
  const auto stream = spool.Find(key);
  FUZZ_CHECK(stream && stream->end && stream->end->last_seq == stream->end_seq - 1);
  uint32_t next = stream->durable_seq + 1;
  uint64_t rows = 0;
  for (int reads = 0; next < stream->end_seq; ++reads) {
    FUZZ_CHECK(reads < 100'000);
    const auto batch = spool.Read(key, next, 7);
    FUZZ_CHECK(batch.ok() && rigcal::CheckShape(*batch).ok());
    FUZZ_CHECK(batch->rows() > 0 || !batch->dropped.empty());
    for (const DroppedRange& range : batch->dropped) {
      FUZZ_CHECK(range.first_seq == next);
      next += range.count;
    }
    FUZZ_CHECK(batch->first_seq == next);
    next = batch->end_seq();
    rows += batch->rows();
  }
  FUZZ_CHECK(next == stream->end_seq);
  FUZZ_CHECK(spool.Find(key)->row_count == rows);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const bool kQuiet = (spdlog::set_level(spdlog::level::off), true);
  FUZZ_CHECK(kQuiet);
  rigcal::testing::FuzzInput input(data, size);
  const int mode = input.Byte();
  ModelFileSystem files;
  files.SetContent(kFirst, Content(mode, input));
  if ((mode & 4) != 0) files.SetContent(kSecond, Header(41));
  DiskSpoolOptions options;
  options.folder = "/model";
  options.has_thread = false;
  const auto spool = DiskSpool::Create(options, &files);
  FUZZ_CHECK(spool.ok());
  for (const auto& stream : (*spool)->Streams()) CheckStream(**spool, stream.stream);
  FUZZ_CHECK((*spool)->Status().problem.empty());
  return 0;
}
