// SPDX-License-Identifier: Apache-2.0
// Events per second of decoder and blink filter, one thread, beside the plain ways of
// tests/testing/textbook_events.h and two reference figures of the memory. Decode: EVT 3.0 to
// events of eight bytes, for the kernels in batches. Chain: decode, filter, and blobs fifty times
// per second. Take: what the agent runs, including the search for the wand in those blobs. Each
// with the kernels of this CPU, the plainest first; the last is the default. Mev_s: million events
// per second. Below the table: speed relative to the textbook (medians). Streams:
// tests/testing/event_streams.h.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <functional>
#include <map>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "agent/detect/event/blink_filter.h"
#include "agent/detect/event/blink_wand_detector.h"
#include "agent/event/event_decoder.h"
#include "tests/bench/suites.h"
#include "tests/testing/event_streams.h"
#include "tests/testing/textbook_events.h"

namespace rigcal::testing::event_bench {
namespace {

constexpr double kOutputHz = 50;
constexpr size_t kChunkBytes = size_t{64} << 10;  // as the `raw:` source delivers them

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

// Only makes sure that the batches are written.
struct BatchCounter {
  size_t count = 0;

  void Events(std::span<const agent::PackedEvent> events) {
    count += events.size();
    benchmark::DoNotOptimize(events.data());
    benchmark::ClobberMemory();
  }
  void Trigger(const agent::TriggerEvent&) {}
  void TimeStepBack(int64_t) {}
};

void ReportDecoding(size_t count, const EventStream& stream, benchmark::State& state) {
  if (count != stream.events.size()) state.SkipWithError("not all events were decoded");
  Report(stream, state);
}

void DecodeTextbook(benchmark::State& state, const EventStreamOptions& options) {
  const EventStream& stream = Stream(options);
  std::vector<agent::PackedEvent> events(stream.events.size() + 64);
  size_t count = 0;
  for (auto _ : state) {
    agent::PackedEvent* to = events.data();
    DecodeTextbookEvt3(stream.evt3, [&to](uint32_t x, uint32_t y, bool on, uint32_t time_us) {
      *to++ = {time_us, static_cast<uint16_t>(x), static_cast<uint16_t>(y | (on ? 0x8000u : 0u))};
    });
    count = static_cast<size_t>(to - events.data());
    benchmark::ClobberMemory();
  }
  ReportDecoding(count, stream, state);
}

void Decode(benchmark::State& state, const EventStreamOptions& options,
            const agent::Evt3Kernel& kernel) {
  const EventStream& stream = Stream(options);
  BatchCounter counter;
  for (auto _ : state) {
    counter.count = 0;
    agent::Evt3Decoder decoder(kStreamGeometry, kernel);
    DecodeInBatches(decoder, stream.evt3, counter);
  }
  ReportDecoding(counter.count, stream, state);
}

// Positions in the stream at the output times.
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

void ReportChain(double blobs, size_t outputs, int bytes_per_pixel, const EventStream& stream,
                 benchmark::State& state) {
  Report(stream, state);
  state.counters["blobs"] = blobs / static_cast<double>(outputs);
  state.counters["bytes_px"] = bytes_per_pixel;
}

void ChainTextbook(benchmark::State& state, const EventStreamOptions& options) {
  const EventStream& stream = Stream(options);
  const auto detector = TextbookBlobDetector();
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat1b image;
  size_t blobs = 0, outputs = 0;
  for (auto _ : state) {
    TextbookBlinkFilter filter(kStreamGeometry, options.blink_hz, 0.15);
    blobs = outputs = 0;
    DecodeTextbookEvt3(stream.evt3, [&](uint32_t x, uint32_t y, bool on, uint32_t time_us) {
      if (time_us >= 1e6 / kOutputHz * static_cast<double>(outputs + 1)) {
        ++outputs;
        filter.Image(time_us, &image);
        detector->detect(image, keypoints);
        blobs += keypoints.size();
      }
      filter.Event(x, y, on, time_us);
    });
  }
  ReportChain(static_cast<double>(blobs), outputs, TextbookBlinkFilter::kBytesPerPixel, stream,
              state);
}

void Chain(benchmark::State& state, const EventStreamOptions& options,
           const agent::Evt3Kernel& kernel, const agent::BlinkKernel& blink_kernel) {
  const EventStream& stream = Stream(options);
  const std::vector<size_t> cuts = CutsAtOutputs(stream);
  const std::span<const uint8_t> bytes(stream.evt3);
  agent::BlinkFilterOptions filter_options;
  filter_options.geometry = kStreamGeometry;
  filter_options.blink_hz = {options.blink_hz};
  size_t blobs = 0;
  for (auto _ : state) {
    agent::BlinkFilter filter = *agent::BlinkFilter::Create(filter_options, blink_kernel);
    agent::Evt3Decoder decoder(kStreamGeometry, kernel);
    size_t begin = 0;
    blobs = 0;
    for (const size_t cut : cuts) {
      DecodeInBatches(decoder, bytes.subspan(begin, cut - begin), filter);
      begin = cut;
      const auto time_us = static_cast<uint32_t>(decoder.time_us());
      filter.Sweep(time_us);
      if (cut != stream.evt3.size()) blobs += filter.FindBlobs(time_us).size();
    }
  }
  ReportChain(static_cast<double>(blobs), cuts.size() - 1, agent::BlinkFilter::kBytesPerPixel,
              stream, state);
}

void Take(benchmark::State& state, const EventStreamOptions& options) {
  const EventStream& stream = Stream(options);
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  target.blink_hz = {options.blink_hz};
  CameraDescription camera;
  camera.camera = "bench";
  camera.image_size_px = {kStreamGeometry.width, kStreamGeometry.height};
  agent::BlinkWandDetectorOptions detector_options;
  detector_options.output.rate_hz = kOutputHz;
  std::vector<agent::Detection> found;
  double blobs = 0;
  for (auto _ : state) {
    auto detector = agent::BlinkWandDetector::Create(detector_options, target, camera,
                                                     agent::EventFormat::kEvt3, false);
    if (!detector.ok()) return state.SkipWithError(detector.status().ToString().c_str());
    found.clear();
    for (std::span<const uint8_t> rest(stream.evt3); !rest.empty();) {
      const size_t size = std::min(rest.size(), kChunkBytes);
      detector->Take(rest.first(size), &found);
      rest = rest.subspan(size);
    }
    detector->Finish(&found);
  }
  for (const agent::Detection& detection : found) blobs += detection.blob_count;
  ReportChain(blobs, found.size(), agent::BlinkFilter::kBytesPerPixel, stream, state);
}

// The filter has fewer kernels than the decoder.
const agent::BlinkKernel& BlinkKernelBeside(const agent::Evt3Kernel& decoder) {
  const std::vector<const agent::BlinkKernel*> kernels = agent::AvailableBlinkKernels();
  for (const agent::BlinkKernel* kernel : kernels) {
    if (std::strcmp(kernel->name, decoder.name) == 0) return *kernel;
  }
  return *kernels.front();
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

void MemoryCopy(benchmark::State& state) {
  const std::vector<uint64_t> data(16 << 20, 1);
  std::vector<uint64_t> copy(data.size());
  for (auto _ : state) {
    std::memcpy(copy.data(), data.data(), data.size() * 8);
    benchmark::ClobberMemory();
  }
  state.SetBytesProcessed(static_cast<int64_t>(state.iterations() * data.size() * 8));
}

// Rows are named event/STREAM/STEP/WAY; each step has one of the textbook.
void Register() {
  benchmark::RegisterBenchmark("event/MemoryRead", MemoryRead)->Unit(benchmark::kMillisecond);
  benchmark::RegisterBenchmark("event/MemoryCopy", MemoryCopy)->Unit(benchmark::kMillisecond);
  using Row = std::function<void(benchmark::State&)>;
  for (const EventStreamOptions& options : BenchStreams()) {
    std::vector<std::pair<std::string, Row>> rows;
    rows.emplace_back("Decode/Textbook", [=](auto& state) { DecodeTextbook(state, options); });
    for (const agent::Evt3Kernel* kernel : agent::AvailableEvt3Kernels()) {
      rows.emplace_back(absl::StrCat("Decode/", kernel->name),
                        [=](auto& state) { Decode(state, options, *kernel); });
    }
    rows.emplace_back("Chain/Textbook", [=](auto& state) { ChainTextbook(state, options); });
    for (const agent::Evt3Kernel* kernel : agent::AvailableEvt3Kernels()) {
      rows.emplace_back(absl::StrCat("Chain/", kernel->name), [=](auto& state) {
        Chain(state, options, *kernel, BlinkKernelBeside(*kernel));
      });
    }
    rows.emplace_back("Chain/Take", [=](auto& state) { Take(state, options); });
    for (const auto& [name, row] : rows) {
      benchmark::RegisterBenchmark(absl::StrCat("event/", options.name, "/", name).c_str(), row)
          ->Unit(benchmark::kMillisecond);
    }
  }
}

void PrintRatios(const bench::MeasuredTimes& times) {
  for (const std::string& name : times.names()) {
    const std::string textbook = absl::StrCat(name.substr(0, name.rfind('/')), "/Textbook");
    if (!absl::StartsWith(name, "event/") || name == textbook || !times.Contains(textbook)) {
      continue;
    }
    std::printf("%-30s %6.2f x the textbook's\n", name.c_str(),
                times.Median(textbook) / times.Median(name));
  }
}

}  // namespace
}  // namespace rigcal::testing::event_bench

namespace rigcal::bench {

Suite EventSuite() {
  return {"event", "event decoder and blink filter, against textbook implementations",
          testing::event_bench::Register, testing::event_bench::PrintRatios};
}

}  // namespace rigcal::bench
