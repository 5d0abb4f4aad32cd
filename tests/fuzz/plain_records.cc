// SPDX-License-Identifier: Apache-2.0
// Records of files for interchange: any bytes, any geometry; nothing outside it, every record
// counted once, and times within an epoch in order but for the jitter that is let through.
#include <algorithm>
#include <cstdint>

#include "agent/event/plain_events.h"
#include "tests/fuzz/decoder_fuzz.h"
#include "tests/fuzz/fuzz_check.h"

using ::rigcal::agent::PlainClock;
using ::rigcal::agent::PlainEventDecoder;
using ::rigcal::agent::TriggerEvent;
using ::rigcal::testing::DecoderCase;

namespace {

class Sink {
 public:
  Sink(const DecoderCase& given, const PlainEventDecoder* decoder)
      : geometry_(given.geometry), decoder_(*decoder) {}

  void Event(uint32_t x, uint32_t y, bool, uint32_t time_us) {
    FUZZ_CHECK(x < geometry_.width && y < geometry_.height);
    const auto behind = static_cast<uint32_t>(decoder_.time_us()) - time_us;
    FUZZ_CHECK(behind <= PlainClock::kJitterUs);
    ++told_;
  }
  void Vector(uint32_t, uint32_t, bool, uint32_t, uint32_t) { FUZZ_CHECK(false); }
  void Trigger(const TriggerEvent& trigger) {
    FUZZ_CHECK(std::abs(trigger.time_us) <= PlainClock::kMaxUs);
    const int64_t behind = decoder_.time_us() - trigger.time_us;
    FUZZ_CHECK(behind >= 0 && behind <= PlainClock::kJitterUs);
    ++told_;
  }
  void TimeStepBack(int64_t time_us) { FUZZ_CHECK(time_us == decoder_.time_us()); }

  uint64_t told() const { return told_; }

 private:
  const rigcal::agent::SensorGeometry geometry_;
  const PlainEventDecoder& decoder_;
  uint64_t told_ = 0;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const DecoderCase given = DecoderCase::From(data, size);
  const size_t words = given.bytes.size() / PlainEventDecoder::kWordBytes;
  std::vector<size_t> ends;
  if (words != 0) {
    for (const size_t cut : given.cuts) ends.push_back(cut % words);
  }
  std::sort(ends.begin(), ends.end());
  ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
  PlainEventDecoder decoder(given.geometry);
  Sink sink(given, &decoder);
  rigcal::testing::ForEachPiece(
      given, PlainEventDecoder::kWordBytes, ends,
      [&](std::span<const uint8_t> piece) { decoder.Decode(piece, sink); });
  const auto& faults = decoder.faults();
  FUZZ_CHECK(sink.told() + faults.unknown_words + faults.outside_geometry == words);
  FUZZ_CHECK(faults.truncated_bytes == given.bytes.size() % PlainEventDecoder::kWordBytes);
  return 0;
}
