// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "agent/event/event_batcher.h"
#include "agent/event/event_decoder.h"
#include "tests/fuzz/decoded_stream.h"
#include "tests/fuzz/fuzz_check.h"
#include "tests/fuzz/fuzz_input.h"
#include "tests/fuzz/reference_decoders.h"

namespace rigcal::testing {

// Input of the decoders' targets: width and height (16 bits each, modulo what a sensor can have),
// a byte with the number of cuts (0 to 15), each cut (16 bits, a word's number modulo the words
// there are); the rest is the stream.
struct DecoderCase {
  agent::SensorGeometry geometry;
  std::vector<size_t> cuts;  // as drawn
  std::span<const uint8_t> bytes;

  static DecoderCase From(const uint8_t* data, size_t size) {
    FuzzInput input(data, size);
    DecoderCase result;
    result.geometry.width = input.Between(1, 2048);
    result.geometry.height = input.Between(1, 2048);
    result.cuts.resize(input.Byte() % 16);
    for (size_t& cut : result.cuts) cut = input.Word16();
    result.bytes = input.rest();
    return result;
  }
};

// Feeds the stream in pieces that end behind the words named, each a copy of its own size, so that
// a look behind its end is seen. `decode(piece)` for each.
template <typename Decode>
void ForEachPiece(const DecoderCase& given, size_t word_bytes, const std::vector<size_t>& ends,
                  Decode decode) {
  size_t begin = 0;
  const auto feed = [&](size_t end) {
    const std::vector<uint8_t> piece(given.bytes.begin() + static_cast<std::ptrdiff_t>(begin),
                                     given.bytes.begin() + static_cast<std::ptrdiff_t>(end));
    decode(std::span<const uint8_t>(piece));
    begin = end;
  };
  for (const size_t word : ends) feed((word + 1) * word_bytes);
  feed(given.bytes.size());
}

// Word by word into a sink.
template <typename Decoder>
DecodedStream DecodeInPieces(Decoder decoder, const DecoderCase& given,
                             const std::vector<size_t>& ends) {
  CheckingSink sink(given.geometry);
  ForEachPiece(given, Decoder::kWordBytes, ends,
               [&](std::span<const uint8_t> piece) { decoder.Decode(piece, sink); });
  return {.told = sink.TakeTold(), .faults = decoder.faults(), .time_us = decoder.time_us()};
}

// In batches, which is where other code may run.
template <typename Decoder>
DecodedStream DecodeBatches(Decoder decoder, const DecoderCase& given,
                            const std::vector<size_t>& ends) {
  CheckingConsumer consumer(given.geometry);
  ForEachPiece(given, Decoder::kWordBytes, ends, [&](std::span<const uint8_t> piece) {
    agent::DecodeInBatches(decoder, piece, consumer);
  });
  return {.told = consumer.TakeTold(), .faults = decoder.faults(), .time_us = decoder.time_us()};
}

inline uint64_t Placed(const DecodedStream& stream) {
  const auto told = static_cast<uint64_t>(
      std::count_if(stream.told.begin(), stream.told.end(),
                    [](const Told& t) { return t.kind != Told::Kind::kStepBack; }));
  return told + stream.faults.before_time + stream.faults.outside_geometry;
}

// `reference` has decoded the whole stream.
template <typename Decoder, typename Reference>
void CheckDecoder(const Decoder& fresh, const DecoderCase& given, const Reference& reference) {
  FUZZ_CHECK(DecodeInPieces(fresh, given, {}) == reference.result);
  FUZZ_CHECK(DecodeBatches(fresh, given, {}) == reference.result);
  const size_t words = given.bytes.size() / Decoder::kWordBytes;
  if (words == 0) return;
  std::vector<size_t> ends, safe_ends;
  for (const size_t cut : given.cuts) ends.push_back(cut % words);
  std::sort(ends.begin(), ends.end());
  ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
  for (const size_t end : ends) {
    if (reference.cut_is_safe[end]) safe_ends.push_back(end);
  }
  FUZZ_CHECK(DecodeInPieces(fresh, given, safe_ends) == reference.result);
  FUZZ_CHECK(DecodeBatches(fresh, given, safe_ends) == reference.result);
  // A doubtful time that waits for the next one may be decided differently; no event is lost.
  const DecodedStream anyhow = DecodeInPieces(fresh, given, ends);
  FUZZ_CHECK(Placed(anyhow) == Placed(reference.result));
  FUZZ_CHECK(DecodeBatches(fresh, given, ends) == anyhow);
}

}  // namespace rigcal::testing
