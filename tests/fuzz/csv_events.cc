// SPDX-License-Identifier: Apache-2.0
// CSV files of events. Input: a byte that says how times and columns are to be read, then the file.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <string>
#include <vector>

#include "agent/event_files/csv_event_reader.h"
#include "tests/fuzz/fuzz_check.h"

using ::rigcal::agent::OpenCsvEvents;
using ::rigcal::agent::PlainEvent;
using ::rigcal::agent::EventFileOptions;
using ::rigcal::agent::TimeUnit;

namespace {

// A file in memory alone.
class MemoryFile {
 public:
  MemoryFile(const uint8_t* data, size_t size) : descriptor_(memfd_create("events", 0)) {
    FUZZ_CHECK(descriptor_ >= 0);
    FUZZ_CHECK(write(descriptor_, data, size) == static_cast<ssize_t>(size));
  }
  ~MemoryFile() { close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
};

struct WholeFile {
  absl::Status status;
  std::vector<PlainEvent> events;
  uint64_t refused = 0;
};

WholeFile ReadAll(const std::string& path, const EventFileOptions& options, size_t block) {
  WholeFile whole;
  auto reader = OpenCsvEvents(path, options);
  whole.status = reader.status();
  if (!reader.ok()) return whole;
  FUZZ_CHECK((*reader)->header().format_name == "CSV");
  FUZZ_CHECK((*reader)->header().time_unit != TimeUnit::kAuto);
  std::vector<PlainEvent> events;
  while (true) {
    whole.status = (*reader)->Read(block, &events);
    if (!whole.status.ok() || events.empty()) break;
    FUZZ_CHECK(events.size() <= block);
    for (size_t i = 0; i < events.size(); ++i) {
      FUZZ_CHECK(events[i].kind <= PlainEvent::kUnreadable);
      FUZZ_CHECK((*reader)->PlaceInBlock(i).starts_with("line "));
    }
    whole.events.insert(whole.events.end(), events.begin(), events.end());
  }
  for (const auto& refusal : (*reader)->Refused()) whole.refused += refusal.count;
  return whole;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  static const char* const orders[] = {"xypt", "txyp", "ptyx", "xyt"};
  const EventFileOptions options{.time_unit = static_cast<TimeUnit>(data[0] % 4),
                                 .columns = orders[data[0] / 4 % 4]};
  const MemoryFile file(data + 1, size - 1);
  const WholeFile whole = ReadAll(file.path(), options, 100'000);
  const WholeFile blocks = ReadAll(file.path(), options, 3);
  FUZZ_CHECK(whole.status.code() == blocks.status.code());
  FUZZ_CHECK(whole.status.ok() || !whole.status.message().empty());
  FUZZ_CHECK(whole.events == blocks.events || !whole.status.ok());
  FUZZ_CHECK(whole.refused == blocks.refused);
  FUZZ_CHECK(whole.events.size() <= size);
  return 0;
}
