// SPDX-License-Identifier: Apache-2.0
// Events per second of decoder and blink filter, one thread, beside the plain ways of
// tests/testing/textbook_events.h and two yardsticks of the memory, in one run:
//
//   build/release/tests/bench.event_bench
//
// Decode: EVT 3.0 to events of eight bytes. Chain: decode, filter, and blobs fifty times per
// second. Mev_s: million events per second. Streams: tests/testing/event_streams.h.
#include <benchmark/benchmark.h>

#include <bit>
#include <cstring>
#include <map>
#include <opencv2/core.hpp>

#include "absl/strings/str_cat.h"
#include "agent/detect/blink_filter.h"
#include "agent/event/event_decoder.h"
#include "tests/testing/event_streams.h"
#include "tests/testing/textbook_events.h"

namespace rigcal::testing {
namespace {

constexpr double kOutputHz = 50;

const EventStream& Stream(const EventStreamOptions& options) {
  static auto* const streams = new std::map<std::string, EventStream>;
  const auto found = streams->find(options.name);
  return found != streams->end()
             ? found->second
             : streams->emplace(options.name, MakeEventStream(options)).first->second;
}

void Report(const EventStream& stream, benchmark::State& state) {
  state.counters["Mev_s"] = benchmark::Counter(1e-6 * static_cast<double>(stream.events.size()),
                                               benchmark::Counter::kIsIterationInvariantRate);
}

// Writes events of eight bytes.
struct EventWriter {
  agent::PackedEvent* to;

  void Row(uint32_t) {}
  void Event(uint32_t x, uint32_t y, bool on, uint32_t time_us) {
    *to++ = {time_us, static_cast<uint16_t>(x), static_cast<uint16_t>(y | (on ? 0x8000u : 0u))};
  }
  void Vector(uint32_t x, uint32_t y, bool on, uint32_t time_us, uint32_t mask) {
    for (; mask != 0; mask &= mask - 1) {
      Event(x + static_cast<uint32_t>(std::countr_zero(mask)), y, on, time_us);
    }
  }
  void Trigger(const agent::TriggerEvent&) {}
  void TimeStepBack(int64_t) {}
};

void DecodeTextbook(benchmark::State& state, const EventStreamOptions& options) {
  const EventStream& stream = Stream(options);
  std::vector<agent::PackedEvent> events(stream.events.size() + 64);
  for (auto _ : state) {
    EventWriter writer{events.data()};
    DecodeTextbookEvt3(stream.evt3, [&writer](uint32_t x, uint32_t y, bool on, uint32_t time_us) {
      writer.Event(x, y, on, time_us);
    });
    benchmark::DoNotOptimize(writer.to);
    benchmark::ClobberMemory();
  }
  Report(stream, state);
}

void Decode(benchmark::State& state, const EventStreamOptions& options) {
  const EventStream& stream = Stream(options);
  std::vector<agent::PackedEvent> events(stream.events.size() + 64);
  for (auto _ : state) {
    EventWriter writer{events.data()};
    agent::Evt3Decoder decoder(kStreamGeometry);
    decoder.Decode(stream.evt3, writer);
    benchmark::DoNotOptimize(writer.to);
    benchmark::ClobberMemory();
  }
  Report(stream, state);
}

// Calls output(time_us) fifty times per second of events, in between `decode(chunk)`: the stream
// cut where those times fall.
std::vector<size_t> CutsAtOutputs(const EventStream& stream) {
  std::vector<size_t> cuts;
  double next_us = 1e6 / kOutputHz;
  uint32_t low = 0, high = 0;
  for (size_t at = 0; at + 1 < stream.evt3.size(); at += 2) {
    const uint32_t word = static_cast<uint32_t>(stream.evt3[at] | stream.evt3[at + 1] << 8);
    if (word >> 12 == 0x8) high = word & 0xfff;
    if (word >> 12 == 0x6) low = word & 0xfff;
    if ((high << 12) + low < next_us) continue;
    cuts.push_back(at);
    next_us += 1e6 / kOutputHz;
  }
  cuts.push_back(stream.evt3.size());
  return cuts;
}

void ChainTextbook(benchmark::State& state, const EventStreamOptions& options) {
  const EventStream& stream = Stream(options);
  const std::vector<size_t> cuts = CutsAtOutputs(stream);
  const std::span<const uint8_t> bytes(stream.evt3);
  const auto detector = TextbookBlobDetector();
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat1b image;
  double blobs = 0;
  for (auto _ : state) {
    TextbookBlinkFilter filter(kStreamGeometry, options.blink_hz, 0.15);
    size_t begin = 0;
    uint32_t time_us = 0;
    blobs = 0;
    // The textbook decoder has no state to carry over a cut, so the filter is fed through a gate.
    size_t cut = 0;
    DecodeTextbookEvt3(bytes, [&](uint32_t x, uint32_t y, bool on, uint32_t t) {
      if (static_cast<double>(t) >= 1e6 / kOutputHz * static_cast<double>(cut + 1)) {
        ++cut;
        filter.Image(t, &image);
        detector->detect(image, keypoints);
        blobs += static_cast<double>(keypoints.size());
      }
      filter.Event(x, y, on, t);
      time_us = t;
    });
    benchmark::DoNotOptimize(begin);
    benchmark::DoNotOptimize(time_us);
  }
  Report(stream, state);
  state.counters["blobs"] = blobs / static_cast<double>(cuts.size() - 1);
  state.counters["bytes_px"] = TextbookBlinkFilter::kBytesPerPixel;
}

void Chain(benchmark::State& state, const EventStreamOptions& options) {
  const EventStream& stream = Stream(options);
  const std::vector<size_t> cuts = CutsAtOutputs(stream);
  const std::span<const uint8_t> bytes(stream.evt3);
  agent::BlinkFilterOptions filter_options;
  filter_options.geometry = kStreamGeometry;
  filter_options.blink_hz = {options.blink_hz};
  double blobs = 0;
  for (auto _ : state) {
    agent::BlinkFilter filter = *agent::BlinkFilter::Create(filter_options);
    agent::Evt3Decoder decoder(kStreamGeometry);
    size_t begin = 0;
    blobs = 0;
    for (const size_t cut : cuts) {
      agent::BlinkFilter::Pass pass = filter.BeginPass();
      decoder.Decode(bytes.subspan(begin, cut - begin), pass);
      begin = cut;
      const auto time_us = static_cast<uint32_t>(decoder.time_us());
      filter.Sweep(time_us);
      if (cut != stream.evt3.size()) blobs += static_cast<double>(filter.FindBlobs(time_us).size());
    }
  }
  Report(stream, state);
  state.counters["blobs"] = blobs / static_cast<double>(cuts.size() - 1);
  state.counters["bytes_px"] = agent::BlinkFilter::kBytesPerPixel;
}

void MemoryRead(benchmark::State& state) {
  const std::vector<uint64_t> data(16 << 20, 1);
  for (auto _ : state) {
    uint64_t sum = 0;
    for (const uint64_t value : data) sum |= value;
    benchmark::DoNotOptimize(sum);
  }
  state.SetBytesProcessed(static_cast<int64_t>(state.iterations() * data.size() * 8));
}
BENCHMARK(MemoryRead)->Unit(benchmark::kMillisecond);

void MemoryCopy(benchmark::State& state) {
  const std::vector<uint64_t> data(16 << 20, 1);
  std::vector<uint64_t> copy(data.size());
  for (auto _ : state) {
    std::memcpy(copy.data(), data.data(), data.size() * 8);
    benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(static_cast<int64_t>(state.iterations() * data.size() * 8));
}
BENCHMARK(MemoryCopy)->Unit(benchmark::kMillisecond);

void Register() {
  for (const EventStreamOptions& options : BenchStreams()) {
    using Function = void (*)(benchmark::State&, const EventStreamOptions&);
    const std::pair<const char*, Function> functions[] = {{"DecodeTextbook", &DecodeTextbook},
                                                          {"Decode", &Decode},
                                                          {"ChainTextbook", &ChainTextbook},
                                                          {"Chain", &Chain}};
    for (const auto& [name, function] : functions) {
      benchmark::RegisterBenchmark(absl::StrCat(name, "/", options.name).c_str(), function, options)
          ->Unit(benchmark::kMillisecond);
    }
  }
}

}  // namespace
}  // namespace rigcal::testing

int main(int argc, char** argv) {
  cv::setNumThreads(1);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  rigcal::testing::Register();
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
