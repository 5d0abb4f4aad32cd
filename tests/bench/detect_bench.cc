// SPDX-License-Identifier: Apache-2.0
// The whole detector in rendered rooms (room_bench.h), and its way from pixels to blobs, against
// OpenCV and against reading the pixels, one thread. For the latter 64 different 1280x1024 BGR
// images (252 MB, more than caches hold), all buffers re-used. Scenes: `Dark` is a
// room of grey level 40 with noise of 3, three warm discs, reflections and warm clutter on 2 to 5 %
// of the pixels; `Daylight` is the same at level 120, where the colour of every pixel has to be
// computed; `Mottled` is a wall whose hue is near the limit of the range, so that noise decides
// every pixel (OpenCV leaves out blobs that lie within others). Ways:
//   Script     BGR2HSV, inRange, SimpleBlobDetector, as in the published wand scripts
//   OpenCv     BGR2HSV, inRange, findContours, moments: the fastest chain of OpenCV's functions
//   Read       or-ing all bytes together
//   <kernel>   BlobFinder, with each instruction set of this CPU
//   Window     BlobFinder with the best one in a tracked window of 200x200 pixels
// Ratios of the shortest and of the median CPU times of all repetitions are printed at the end.
// Required of the full image, dark or in daylight: OpenCv / ours >= 10, Script / ours >= 25,
// ours / Read <= 2.5, OpenCv / portable >= 3.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "agent/detect/blobs/blob_finder.h"
#include "tests/bench/room_bench.h"
#include "tests/bench/suites.h"

namespace rigcal::agent::detect_bench {
namespace {

constexpr int kImages = 64;
constexpr int kWidth = 1280;
constexpr int kHeight = 1024;
constexpr int kWindow = 200;

ImageView View(const cv::Mat& image) {
  return {image.data, image.cols, image.rows, static_cast<ptrdiff_t>(image.step[0]),
          PixelFormat::kBgr8};
}

void AddNoise(uint32_t seed, cv::Mat* image) {
  cv::RNG random(seed);
  cv::Mat noise(image->size(), CV_16SC3);
  random.fill(noise, cv::RNG::NORMAL, 0, 3);
  cv::add(*image, noise, *image, cv::noArray(), CV_8UC3);
}

cv::Point AnyPoint(std::mt19937* random) {
  return {std::uniform_int_distribution<int>(0, kWidth - 1)(*random),
          std::uniform_int_distribution<int>(0, kHeight - 1)(*random)};
}

struct Scene {
  std::vector<cv::Mat> images;
  std::vector<PixelRect> windows;  // around the discs
};

// Warm patches on about `share` of the image.
void AddClutter(double share, std::mt19937* random, cv::Mat* image) {
  std::uniform_int_distribution<int> size(2, 40), green(60, 130), red(150, 220);
  for (double filled = 0; filled < share * kWidth * kHeight;) {
    const cv::Size axes(size(*random), size(*random));
    cv::ellipse(*image, AnyPoint(random), axes, 30.0 * size(*random), 0, 360,
                cv::Scalar(50, green(*random), red(*random)), cv::FILLED);
    filled += 3.14 * axes.width * axes.height;
  }
}

// The wand's discs, and their fainter reflections below.
PixelRect AddWand(std::mt19937* random, cv::Mat* image) {
  const cv::Point start(std::uniform_int_distribution<int>(60, kWidth - 200)(*random),
                        std::uniform_int_distribution<int>(60, kHeight - 260)(*random));
  const double angle = std::uniform_real_distribution<double>(0, 1.2)(*random);
  for (const double along : {0.0, 50.0, 150.0}) {
    const cv::Point at(start.x + static_cast<int>(along * std::cos(angle)),
                       start.y + static_cast<int>(along * std::sin(angle)));
    cv::circle(*image, at, 8, cv::Scalar(60, 150, 250), cv::FILLED, cv::LINE_AA);
    cv::circle(*image, at + cv::Point(0, 100), 7, cv::Scalar(30, 60, 90), cv::FILLED, cv::LINE_AA);
  }
  return {start.x - 25, start.y - 25, kWindow, kWindow};
}

Scene MakeScene(const cv::Scalar& wall_bgr) {
  Scene scene;
  std::mt19937 random(3);
  for (int i = 0; i < kImages; ++i) {
    cv::Mat image(kHeight, kWidth, CV_8UC3, wall_bgr);
    AddClutter(std::uniform_real_distribution<double>(0.02, 0.05)(random), &random, &image);
    scene.windows.push_back(AddWand(&random, &image));
    AddNoise(static_cast<uint32_t>(i) + 1, &image);
    scene.images.push_back(image);
  }
  return scene;
}

// The default ColourRange in OpenCV's units (half degrees; 255).
class HsvMask {
 public:
  const cv::Mat& Mask(const cv::Mat& image) {
    cv::cvtColor(image, hsv_, cv::COLOR_BGR2HSV);
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
    detector->detect(hsv.Mask(scene.images[next++ % kImages]), points);
    found += points.size();
  }
  state.counters["blobs"] = static_cast<double>(found) / static_cast<double>(next);
}

void OpenCv(benchmark::State& state, const Scene& scene) {
  HsvMask hsv;
  std::vector<std::vector<cv::Point>> contours;
  size_t next = 0, found = 0;
  for (auto _ : state) {
    cv::findContours(hsv.Mask(scene.images[next++ % kImages]), contours, cv::RETR_EXTERNAL,
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
    const cv::Mat& image = scene.images[next++ % kImages];
    benchmark::DoNotOptimize(OrAll(reinterpret_cast<const uint64_t*>(image.data),
                                   image.total() * image.elemSize() / sizeof(uint64_t)));
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
  size_t next = 0, found = 0;
  for (auto _ : state) {
    const size_t i = next++ % kImages;
    const ImageView image = View(scene.images[i]);
    const BlobResult& result = finder.Find(image, tracked ? scene.windows[i] : image.Bounds());
    found += result.blobs.size();
  }
  state.counters["blobs"] = static_cast<double>(found) / static_cast<double>(next);
}

// Only the scene in use is kept in memory.
const Scene& SceneOf(const std::string& name) {
  static Scene scene;
  static std::string current;
  if (current != name) {
    scene = {};
    if (name == "Dark") scene = MakeScene(cv::Scalar::all(40));
    if (name == "Daylight") scene = MakeScene(cv::Scalar::all(120));
    if (name == "Mottled") scene = MakeScene(cv::Scalar(60, 134, 150));
    current = name;
  }
  return scene;
}

constexpr const char* kScenes[] = {"Dark", "Daylight", "Mottled"};

void Register() {
  for (const std::string scene : kScenes) {
    const auto add = [&scene](const std::string& way, auto run) {
      benchmark::RegisterBenchmark(
          absl::StrCat("detect/", scene, "/", way).c_str(),
          [scene, run](benchmark::State& state) { run(state, SceneOf(scene)); })
          ->Unit(benchmark::kMillisecond);
    };
    add("Script", Script);
    add("OpenCv", OpenCv);
    add("Read", Read);
    for (const MaskKernel* kernel : AvailableMaskKernels()) {
      add(kernel->name, [kernel](benchmark::State& state, const Scene& images) {
        Ours(state, images, kernel, false);
      });
    }
    add("Window", [](benchmark::State& state, const Scene& images) {
      Ours(state, images, &BestMaskKernel(), true);
    });
  }
  bench::RegisterRooms();
}

void PrintRatios(const bench::MeasuredTimes& times) {
  for (const std::string scene : kScenes) {
    const char* best = BestMaskKernel().name;
    for (const auto& [slow, fast] : {std::pair<const char*, const char*>("OpenCv", best),
                                     {"Script", best},
                                     {best, "Read"},
                                     {"OpenCv", "portable"},
                                     {best, "Window"}}) {
      const std::string above = absl::StrCat("detect/", scene, "/", slow);
      const std::string below = absl::StrCat("detect/", scene, "/", fast);
      if (!times.Contains(above) || !times.Contains(below)) continue;
      std::printf("%-25s / %-25s %7.2f of shortest, %7.2f of medians\n", above.c_str(),
                  below.c_str(), times.Shortest(above) / times.Shortest(below),
                  times.Median(above) / times.Median(below));
    }
  }
  bench::PrintRoomRatios(times);
}

}  // namespace
}  // namespace rigcal::agent::detect_bench

namespace rigcal::bench {

Suite DetectSuite() {
  return {"detect", "blobs in whole images and wands in rooms, against chains of OpenCV functions",
          agent::detect_bench::Register, agent::detect_bench::PrintRatios};
}

}  // namespace rigcal::bench
