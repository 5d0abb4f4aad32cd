// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/room_bench.h"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/accuracy/detection/photographs.h"
#include "tests/accuracy/detection/rendered_room.h"
#include "tests/accuracy/detection/room_cases.h"
#include "tests/accuracy/thread_cpu.h"
#include "tests/bench/must.h"
#include "tests/bench/opencv_wand_chain.h"

namespace rigcal::bench {
namespace {

using accuracy::DetectionCase;
using accuracy::DetectionOptions;
using accuracy::RenderedRoom;

constexpr int kRooms = 3, kFramesOfRoom = 12;
constexpr uint32_t kSeed = 20;
constexpr double kFoundPx = 1, kFalsePx = 3;
constexpr double kOften = 0.5;  // of the wands

struct RoomImage {
  cv::Mat bgr;
  bool has_wand = false, is_whole = false;
  std::vector<Eigen::Vector2d> true_px;  // by marker
};

struct Room {
  std::string name;
  DetectionOptions options;
  std::vector<RoomImage> images;
};

std::string NameOf(const DetectionCase& entry) {
  std::string name;
  for (const char c : entry.name) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0) {
      name += c;
    } else if (!name.empty() && name.back() != '_') {
      name += '_';
    }
  }
  if (name.back() == '_') name.pop_back();
  return name;
}

Room Render(const DetectionCase& entry) {
  Room room{NameOf(entry), accuracy::PaperDetection(), {}};
  room.options.seed = kSeed;
  room.options.detector.tracking = false;
  entry.change(&room.options);
  room.options.detector.exposure_s = room.options.render.exposure_s;
  for (int r = 0; r < kRooms; ++r) {
    RenderedRoom rendered = Must(RenderedRoom::Create(room.options, r));
    for (int i = 0; i < kFramesOfRoom; ++i) {
      const accuracy::RoomFrame frame = Must(rendered.Render(i));
      RoomImage& image = room.images.emplace_back();
      const agent::ImageView view = rendered.view();
      image.bgr = cv::Mat(view.height, view.width, CV_8UC3, const_cast<uint8_t*>(view.data),
                          static_cast<size_t>(view.stride_bytes))
                      .clone();
      image.has_wand = frame.wand.has_value();
      if (!frame.wand) continue;
      image.is_whole = frame.lit && testing::WandVisible(
                                        *room.options.camera.intrinsics,
                                        room.options.camera.image_size_px, room.options.target,
                                        *frame.wand, frame.truth.bar ? &*frame.truth.bar : nullptr);
      for (const auto& marker : frame.truth.markers) image.true_px.push_back(marker.centre_px);
    }
  }
  return room;
}

// Only the room in use is kept in memory.
const Room& RoomOf(const DetectionCase& entry) {
  static Room room;
  if (room.name != NameOf(entry)) {
    room = {};
    room = Render(entry);
  }
  return room;
}

// How often a way finds the wands, and how long it takes for each image.
class Score {
 public:
  explicit Score(size_t images) : ms_(images, std::numeric_limits<double>::infinity()) {}

  // `seen_px` by marker, empty: none.
  void Take(size_t index, double ms, const RoomImage& image,
            const std::vector<Eigen::Vector2d>& seen_px) {
    const bool is_first = !(ms_[index] < std::numeric_limits<double>::infinity());
    ms_[index] = std::min(ms_[index], ms);
    if (!is_first) return;
    double worst_px = seen_px.empty() ? std::numeric_limits<double>::infinity() : 0;
    for (size_t k = 0; k < seen_px.size() && k < image.true_px.size(); ++k) {
      if (seen_px[k].allFinite()) {
        worst_px = std::max(worst_px, (seen_px[k] - image.true_px[k]).norm());
      }
    }
    wands_ += image.is_whole ? 1 : 0;
    found_ += image.is_whole && worst_px < kFoundPx ? 1 : 0;
    false_ += !seen_px.empty() && (!image.has_wand || worst_px > kFalsePx) ? 1 : 0;
  }

  double FoundShare() const { return wands_ > 0 ? static_cast<double>(found_) / wands_ : 0; }

  void Report(benchmark::State* state) const {
    std::vector<double> measured;
    for (const double ms : ms_) {
      if (ms < std::numeric_limits<double>::infinity()) measured.push_back(ms);
    }
    if (measured.empty()) return;
    std::ranges::sort(measured);
    state->counters["median_ms"] = measured[measured.size() / 2];
    state->counters["worst_ms"] = measured.back();
    if (wands_ > 0) state->counters["found_%"] = 100 * FoundShare();
    state->counters["false"] = false_;
  }

 private:
  std::vector<double> ms_;
  int wands_ = 0, found_ = 0, false_ = 0;
};

// Of the rooms, by name, in which OpenCV's chain finds wands.
std::map<std::string, double>& FoundByOpenCv() {
  static std::map<std::string, double> shares;
  return shares;
}

template <typename Find>
Score Measure(benchmark::State* state, const Room& room, const Find& find) {
  Score score(room.images.size());
  size_t next = 0;
  for (auto _ : *state) {
    const size_t i = next++ % room.images.size();
    const double begin_s = accuracy::ThreadCpuS();
    const std::vector<Eigen::Vector2d> seen_px = find(room.images[i]);
    score.Take(i, 1e3 * (accuracy::ThreadCpuS() - begin_s), room.images[i], seen_px);
  }
  score.Report(state);
  return score;
}

void RunDetector(benchmark::State& state, const Room& room) {
  agent::WandDetector detector = Must(
      agent::WandDetector::Create(room.options.detector, room.options.target, room.options.camera));
  int64_t time_ns = 0;
  Measure(&state, room, [&](const RoomImage& image) {
    const agent::ImageView view{image.bgr.data, image.bgr.cols, image.bgr.rows,
                                static_cast<ptrdiff_t>(image.bgr.step[0]),
                                agent::PixelFormat::kBgr8};
    const agent::Detection detection = Must(detector.Detect(view, time_ns += 1'000'000'000, 0));
    std::vector<Eigen::Vector2d> seen_px;
    if (detection.outcome != DetectionOutcome::kWand) return seen_px;
    for (const MarkerObservation& marker : detection.observation.markers) {
      seen_px.push_back(marker.visible
                            ? marker.centre_px
                            : Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()));
    }
    return seen_px;
  });
}

void RunOpenCv(benchmark::State& state, const Room& room) {
  const std::vector<double>& positions_m = room.options.target.marker_positions_m;
  OpenCvWandChain chain((positions_m[1] - positions_m[0]) / (positions_m[2] - positions_m[0]));
  const Score score = Measure(&state, room, [&](const RoomImage& image) {
    std::vector<Eigen::Vector2d> seen_px;
    if (const auto found = chain.Find(image.bgr)) {
      for (const cv::Point2d& at : *found) seen_px.emplace_back(at.x, at.y);
    }
    return seen_px;
  });
  FoundByOpenCv()[room.name] = score.FoundShare();
}

}  // namespace

void RegisterRooms() {
  for (const DetectionCase& entry : accuracy::RoomCases(accuracy::FindPhotographs())) {
    const auto add = [&entry](const char* way, int passes, auto run) {
      benchmark::RegisterBenchmark(
          absl::StrCat("detect/room/", NameOf(entry), "/", way).c_str(),
          [entry, run](benchmark::State& state) { run(state, RoomOf(entry)); })
          ->Unit(benchmark::kMillisecond)
          ->Iterations(passes * kRooms * kFramesOfRoom);
    };
    add("Detector", 5, RunDetector);
    add("OpenCv", 1, RunOpenCv);
  }
}

void PrintRoomRatios(const MeasuredTimes& times) {
  for (const auto& [room, share] : FoundByOpenCv()) {
    const std::string chain = absl::StrCat("detect/room/", room, "/OpenCv");
    const std::string ours = absl::StrCat("detect/room/", room, "/Detector");
    if (share < kOften || !times.Contains(chain) || !times.Contains(ours)) continue;
    std::printf("%-40s / %-40s %7.2f of shortest, %7.2f of medians\n", chain.c_str(), ours.c_str(),
                times.Shortest(chain) / times.Shortest(ours),
                times.Median(chain) / times.Median(ours));
  }
}

}  // namespace rigcal::bench
