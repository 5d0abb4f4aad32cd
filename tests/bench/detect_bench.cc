// SPDX-License-Identifier: Apache-2.0
// From pixels to blobs, against OpenCV and against reading the pixels, in one run, one thread:
//
//   build/release/tests/bench.detect_bench [--benchmark_repetitions=5] [--benchmark_filter=Dark]
//
// 64 different 1280x1024 BGR pictures (252 MB, more than caches hold), all buffers re-used. Scenes:
// `Dark` is a room of grey level 40 with noise of 3, three warm discs, reflections and warm clutter
// on 2 to 5 % of the pixels; `Daylight` is the same at level 120, where every pixel is bright
// enough to be asked for its colour; `Mottled` is a wall whose hue lies about the range's limit, so
// that noise decides on every pixel (of its blobs OpenCV leaves out those that lie within others).
// Ways:
//   Script     BGR2HSV, inRange, SimpleBlobDetector: what the published wand scripts do
//   OpenCv     BGR2HSV, inRange, findContours, moments: the fastest chain of OpenCV's functions
//   Read       or-ing all bytes together
//   <kernel>   BlobFinder, with each instruction set this CPU has
//   Window     BlobFinder with the best one in a tracked window of 200x200 pixels
// Ratios of the shortest and of the median CPU times of all repetitions are printed at the end.
// What is wanted of the full picture, dark or in daylight: OpenCv / ours >= 10, Script / ours >=
// 25, ours / Read <= 2.5, OpenCv / portable >= 3.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "agent/detect/blobs/blob_finder.h"

namespace rigcal::agent {
namespace {

constexpr int kPictures = 64;
constexpr int kWidth = 1280;
constexpr int kHeight = 1024;
constexpr int kWindow = 200;

ImageView View(const cv::Mat& picture) {
  return {picture.data, picture.cols, picture.rows, static_cast<ptrdiff_t>(picture.step[0]),
          PixelFormat::kBgr8};
}

void AddNoise(uint32_t seed, cv::Mat* picture) {
  cv::RNG random(seed);
  cv::Mat noise(picture->size(), CV_16SC3);
  random.fill(noise, cv::RNG::NORMAL, 0, 3);
  cv::add(*picture, noise, *picture, cv::noArray(), CV_8UC3);
}

cv::Point AnyPoint(std::mt19937* random) {
  return {std::uniform_int_distribution<int>(0, kWidth - 1)(*random),
          std::uniform_int_distribution<int>(0, kHeight - 1)(*random)};
}

struct Scene {
  std::vector<cv::Mat> pictures;
  std::vector<PixelRect> windows;  // around the discs
};

// Warm patches until `share` of the picture is covered, about.
void AddClutter(double share, std::mt19937* random, cv::Mat* picture) {
  std::uniform_int_distribution<int> size(2, 40), green(60, 130), red(150, 220);
  for (double covered = 0; covered < share * kWidth * kHeight;) {
    const cv::Size axes(size(*random), size(*random));
    cv::ellipse(*picture, AnyPoint(random), axes, 30.0 * size(*random), 0, 360,
                cv::Scalar(50, green(*random), red(*random)), cv::FILLED);
    covered += 3.14 * axes.width * axes.height;
  }
}

// The wand's discs, and fainter below them their reflection.
PixelRect AddWand(std::mt19937* random, cv::Mat* picture) {
  const cv::Point start(std::uniform_int_distribution<int>(60, kWidth - 200)(*random),
                        std::uniform_int_distribution<int>(60, kHeight - 260)(*random));
  const double angle = std::uniform_real_distribution<double>(0, 1.2)(*random);
  for (const double along : {0.0, 50.0, 150.0}) {
    const cv::Point at(start.x + static_cast<int>(along * std::cos(angle)),
                       start.y + static_cast<int>(along * std::sin(angle)));
    cv::circle(*picture, at, 8, cv::Scalar(60, 150, 250), cv::FILLED, cv::LINE_AA);
    cv::circle(*picture, at + cv::Point(0, 100), 7, cv::Scalar(30, 60, 90), cv::FILLED,
               cv::LINE_AA);
  }
  return {start.x - 25, start.y - 25, kWindow, kWindow};
}

Scene MakeScene(const cv::Scalar& wall_bgr) {
  Scene scene;
  std::mt19937 random(3);
  for (int i = 0; i < kPictures; ++i) {
    cv::Mat picture(kHeight, kWidth, CV_8UC3, wall_bgr);
    AddClutter(std::uniform_real_distribution<double>(0.02, 0.05)(random), &random, &picture);
    scene.windows.push_back(AddWand(&random, &picture));
    AddNoise(static_cast<uint32_t>(i) + 1, &picture);
    scene.pictures.push_back(picture);
  }
  return scene;
}

// In OpenCV's units (half degrees; 255) the range that ColourRange has by itself.
class HsvMask {
 public:
  const cv::Mat& Mask(const cv::Mat& picture) {
    cv::cvtColor(picture, hsv_, cv::COLOR_BGR2HSV);
    cv::inRange(hsv_, cv::Scalar(0, 90, 60), cv::Scalar(25, 255, 255), mask_);
    return mask_;
  }

 private:
  cv::Mat hsv_, mask_;
};

void Script(benchmark::State& state, const Scene& scene) {
  HsvMask hsv;
  cv::SimpleBlobDetector::Params params;
  params.filterByColor = true;
  params.blobColor = 255;
  params.minArea = 6;
  const cv::Ptr<cv::SimpleBlobDetector> detector = cv::SimpleBlobDetector::create(params);
  std::vector<cv::KeyPoint> points;
  size_t next = 0, found = 0;
  for (auto _ : state) {
    detector->detect(hsv.Mask(scene.pictures[next++ % kPictures]), points);
    found += points.size();
  }
  state.counters["blobs"] = static_cast<double>(found) / static_cast<double>(next);
}

void OpenCv(benchmark::State& state, const Scene& scene) {
  HsvMask hsv;
  std::vector<std::vector<cv::Point>> contours;
  size_t next = 0, found = 0;
  for (auto _ : state) {
    cv::findContours(hsv.Mask(scene.pictures[next++ % kPictures]), contours, cv::RETR_EXTERNAL,
                     cv::CHAIN_APPROX_SIMPLE);
    for (const std::vector<cv::Point>& contour : contours) {
      const cv::Moments moments = cv::moments(contour);
      if (moments.m00 >= 6) ++found;
    }
  }
  state.counters["blobs"] = static_cast<double>(found) / static_cast<double>(next);
}

#if defined(__x86_64__)
__attribute__((target_clones("avx512f", "avx2", "default")))
#endif
uint64_t
OrAll(const uint64_t* words, size_t count) {
  uint64_t all[32] = {};
  for (size_t i = 0; i + 32 <= count; i += 32) {
    for (size_t k = 0; k < 32; ++k) all[k] |= words[i + k];
  }
  uint64_t result = 0;
  for (const uint64_t word : all) result |= word;
  return result;
}

void Read(benchmark::State& state, const Scene& scene) {
  size_t next = 0;
  for (auto _ : state) {
    const cv::Mat& picture = scene.pictures[next++ % kPictures];
    benchmark::DoNotOptimize(OrAll(reinterpret_cast<const uint64_t*>(picture.data),
                                   picture.total() * picture.elemSize() / sizeof(uint64_t)));
  }
}

BlobFinder MakeFinder(const MaskKernel& kernel) {
  absl::StatusOr<BlobFinder> finder = BlobFinder::Create({}, kernel);
  if (!finder.ok()) {
    std::fprintf(stderr, "%s\n", finder.status().ToString().c_str());
    std::exit(1);
  }
  return *std::move(finder);
}

void Ours(benchmark::State& state, const Scene& scene, const MaskKernel* kernel, bool tracked) {
  BlobFinder finder = MakeFinder(*kernel);
  size_t next = 0, found = 0, pixels = 0;
  for (auto _ : state) {
    const size_t i = next++ % kPictures;
    const ImageView picture = View(scene.pictures[i]);
    const BlobResult& result = finder.Find(picture, tracked ? scene.windows[i] : picture.Bounds());
    found += result.blobs.size();
    pixels += static_cast<size_t>(result.mask_pixels);
  }
  state.counters["blobs"] = static_cast<double>(found) / static_cast<double>(next);
  state.counters["mask_pixels"] = static_cast<double>(pixels) / static_cast<double>(next);
}

// Prints as usual and remembers the time of every repetition.
class RatioReporter : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) {
      if (run.run_type == Run::RT_Iteration && !run.error_occurred) {
        times_ms_[run.run_name.function_name].push_back(run.GetAdjustedCPUTime());
      }
    }
    ConsoleReporter::ReportRuns(runs);
  }

  void PrintRatios(const std::string& scene) const {
    const std::string best = absl::StrCat(scene, "/", BestMaskKernel().name);
    Print(scene, "OpenCv", best);
    Print(scene, "Script", best);
    Print(best, absl::StrCat(scene, "/Read"));
    Print(scene, "OpenCv", absl::StrCat(scene, "/portable"));
    Print(best, absl::StrCat(scene, "/Window"));
  }

 private:
  void Print(const std::string& scene, const std::string& slow, const std::string& fast) const {
    Print(absl::StrCat(scene, "/", slow), fast);
  }
  void Print(const std::string& slow, const std::string& fast) const {
    if (!times_ms_.contains(slow) || !times_ms_.contains(fast)) return;
    const auto [slow_min, slow_median] = Summary(slow);
    const auto [fast_min, fast_median] = Summary(fast);
    std::printf("%-18s / %-18s %7.2f of shortest, %7.2f of medians\n", slow.c_str(), fast.c_str(),
                slow_min / fast_min, slow_median / fast_median);
  }
  std::pair<double, double> Summary(const std::string& name) const {
    std::vector<double> times = times_ms_.at(name);
    std::sort(times.begin(), times.end());
    return {times.front(), times[times.size() / 2]};
  }

  std::map<std::string, std::vector<double>> times_ms_;
};

void Register(const std::string& name, const Scene& scene) {
  const auto add = [&](const std::string& way, auto function) {
    benchmark::RegisterBenchmark(absl::StrCat(name, "/", way).c_str(), function)
        ->Unit(benchmark::kMillisecond);
  };
  add("Script", [&scene](benchmark::State& state) { Script(state, scene); });
  add("OpenCv", [&scene](benchmark::State& state) { OpenCv(state, scene); });
  add("Read", [&scene](benchmark::State& state) { Read(state, scene); });
  for (const MaskKernel* kernel : AvailableMaskKernels()) {
    add(kernel->name,
        [&scene, kernel](benchmark::State& state) { Ours(state, scene, kernel, false); });
  }
  add("Window", [&scene](benchmark::State& state) { Ours(state, scene, &BestMaskKernel(), true); });
}

}  // namespace
}  // namespace rigcal::agent

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  cv::setNumThreads(1);
  const std::pair<std::string, rigcal::agent::Scene> scenes[] = {
      {"Dark", rigcal::agent::MakeScene(cv::Scalar::all(40))},
      {"Daylight", rigcal::agent::MakeScene(cv::Scalar::all(120))},
      {"Mottled", rigcal::agent::MakeScene(cv::Scalar(60, 134, 150))}};
  for (const auto& [name, scene] : scenes) rigcal::agent::Register(name, scene);
  rigcal::agent::RatioReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  for (const auto& [name, scene] : scenes) reporter.PrintRatios(name);
  return 0;
}
