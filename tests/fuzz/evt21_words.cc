// SPDX-License-Identifier: Apache-2.0
// EVT 2.1 in both orders of halves: any words, any geometry, any cuts.
#include "agent/event/event_decoder.h"
#include "tests/fuzz/decoder_fuzz.h"

using ::rigcal::testing::DecoderCase;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const DecoderCase given = DecoderCase::From(data, size);
  for (const bool halves_swapped : {false, true}) {
    rigcal::testing::ReferenceEvt2 reference(given.geometry);
    reference.Decode21(given.bytes, halves_swapped);
    rigcal::testing::CheckDecoder(rigcal::agent::Evt21Decoder(given.geometry, halves_swapped),
                                  given, reference);
  }
  return 0;
}
