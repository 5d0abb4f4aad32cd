// SPDX-License-Identifier: Apache-2.0
// EVT 3.0: any words, any geometry, any cuts, by every kernel that this CPU can run.
#include "agent/event/event_decoder.h"
#include "tests/fuzz/decoder_fuzz.h"

using ::rigcal::testing::DecoderCase;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const DecoderCase given = DecoderCase::From(data, size);
  rigcal::testing::ReferenceEvt3 reference(given.geometry);
  reference.Decode(given.bytes);
  for (const rigcal::agent::Evt3Kernel* kernel : rigcal::agent::AvailableEvt3Kernels()) {
    const rigcal::agent::Evt3Decoder decoder(given.geometry, *kernel);
    rigcal::testing::CheckDecoder(decoder, given, reference);
  }
  return 0;
}
