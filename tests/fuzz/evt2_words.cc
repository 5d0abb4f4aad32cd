// SPDX-License-Identifier: Apache-2.0
// EVT 2.0: any words, any geometry, any cuts.
#include "agent/event/event_decoder.h"
#include "tests/fuzz/decoder_fuzz.h"

using ::rigcal::testing::DecoderCase;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const DecoderCase given = DecoderCase::From(data, size);
  rigcal::testing::ReferenceEvt2 reference(given.geometry);
  reference.Decode(given.bytes);
  rigcal::testing::CheckDecoder(rigcal::agent::Evt2Decoder(given.geometry), given, reference);
  return 0;
}
