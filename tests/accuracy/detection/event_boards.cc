// SPDX-License-Identifier: Apache-2.0
// Boards of circles before an event camera: on screens that blink, and printed and moved. Simulated
// events through the detector to a lens, as `rigcal-agent intrinsics` does.
#include "tests/accuracy/detection/event_boards.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "agent/command/board_pictures.h"
#include "agent/command/board_views.h"
#include "agent/event/evt3_writer.h"
#include "common/lens/lens_solver.h"
#include "common/statistics/robust_statistics.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/common/lens/known_lens.h"
#include "tests/testing/event_board_scene.h"

namespace rigcal::accuracy {
namespace {

constexpr ImageSize kImage{1280, 720};
constexpr double kWatchedS = 40;
constexpr double kSecondsOfPose = 1;
constexpr int64_t kEventSliceUs = 10'000;

struct EventBoardCase {
  std::string name;
  testing::EventBoardLight light;
  std::vector<double> refresh_hz;  // by turns
  bool is_print = false;
  double noise_hz = 1;
};

std::vector<EventBoardCase> EventBoardCases() {
  const testing::EventBoardLight lcd, oled{.response_ms = 0, .black = 0, .ambient = 0.01};
  auto pwm = lcd, glare = lcd, dips = oled, print = lcd;
  pwm.pwm_hz = 240;
  pwm.pwm_depth = 0.6;
  glare.glare = 1.5;
  dips.oled_dip = 0.1;
  print.refresh_hz = 0;
  print.black = 0.04;
  return {{"LCD 60, 75, 120, 144 Hz", lcd, {60, 75, 120, 144}},
          {"LCD, glare, noise of 5 Hz", glare, {60, 75, 120, 144}, false, 5},
          {"LCD, backlight 240 Hz PWM", pwm, {60}},
          {"OLED 60, 120 Hz", oled, {60, 120}},
          {"OLED 60 Hz, dark in each refresh", dips, {60}},
          {"print, moved", print, {0}, true}};
}

Intrinsics EventLens() {
  return {.model = DistortionModel::kBrownConrady,
          .fx_px = 1050,
          .fy_px = 1052,
          .cx_px = 645,
          .cy_px = 352,
          .distortion = {-0.12, 0.05, 0.0004, -0.0003, 0}};
}

// The simulated events as a camera's source.
class SceneSource : public agent::EventSource {
 public:
  SceneSource(testing::EventBoardScene scene, double seconds)
      : scene_(std::move(scene)), end_us_(std::lround(1e6 * seconds)) {
    description_.camera = "event";
    description_.image_size_px = kImage;
  }
  const CameraDescription& description() const override { return description_; }
  absl::Status Start(const Target&) override { return absl::OkStatus(); }
  absl::StatusOr<std::optional<agent::EventChunk>> Next() override {
    if (now_us_ >= end_us_) return std::nullopt;
    now_us_ += kEventSliceUs;
    events_.clear();
    scene_.Render(now_us_, &events_);
    plain_.clear();
    for (const SimulatedEvent& event : events_) {
      plain_.push_back({event.time_us, event.x, event.y, event.on});
    }
    bytes_.clear();
    writer_.Write(plain_, &bytes_);
    return agent::EventChunk{.format = agent::EventFormat::kEvt3, .bytes = bytes_};
  }
  void Stop() override {}

 private:
  testing::EventBoardScene scene_;
  const int64_t end_us_;
  CameraDescription description_;
  int64_t now_us_ = 0;
  std::vector<SimulatedEvent> events_;
  std::vector<agent::CdEvent> plain_;
  std::vector<uint8_t> bytes_;
  agent::Evt3Writer writer_;
};

struct EventBoardResult {
  std::string refused;  // empty: solved
  int pictures = 0, with_board = 0, views = 0;
  double focal_error = 0;  // of fx and fy the greater one, relative
  double rms_px = 0, blink_error = 0, flicker_hz = 0;
};

EventBoardResult Calibrate(const EventBoardCase& how, int seed) {
  const Board board =
      *ParseBoard(how.is_print ? "board:circles,4x11,0.02" : "board:circles,4x11,0.02,0.016");
  const Intrinsics lens = EventLens();
  EventRenderOptions pixels;
  pixels.seed = static_cast<uint32_t>(seed);
  pixels.background_hz = how.noise_hz;
  testing::EventBoardLight light = how.light;
  light.refresh_hz = how.refresh_hz[static_cast<size_t>(seed) % how.refresh_hz.size()];
  light.blink_refreshes = static_cast<int>(std::lround(light.refresh_hz / 12));
  std::vector<RigidTransform> poses =
      testing::WavedBoard(board, lens, kImage, static_cast<int>(kWatchedS / kSecondsOfPose) + 2,
                          0.4, 0.6, 0.8, static_cast<uint32_t>(seed), 0.45);
  const testing::BoardPath path = how.is_print ? testing::Waved(poses, kSecondsOfPose)
                                               : testing::HandHeld(poses, kSecondsOfPose, 0.5);
  auto source = std::make_unique<SceneSource>(
      testing::EventBoardScene(board, lens, kImage, light, pixels, path), kWatchedS);
  EventBoardResult result;
  const auto pictures = agent::PicturesOfEvents(board, std::move(source));
  const auto views =
      agent::CollectBoardViews(board, {.views = 40, .only_different = true}, pictures->get(),
                               [](const agent::BoardViews&) { return true; });
  if (!views.ok()) {
    result.refused = std::string(views.status().message());
    return result;
  }
  result.pictures = views->pictures;
  result.with_board = views->with_board;
  result.views = static_cast<int>(views->views.size());
  result.flicker_hz = views->events->flicker_hz;
  const double blink_hz = light.refresh_hz / (2 * light.blink_refreshes);
  if (!how.is_print) result.blink_error = std::abs(views->events->blink_hz / blink_hz - 1);
  const auto solved = SolveLens(views->views, kImage);
  if (!solved.ok()) {
    result.refused = std::string(solved.status().message());
    return result;
  }
  result.focal_error = std::max(std::abs(solved->intrinsics.fx_px / lens.fx_px - 1),
                                std::abs(solved->intrinsics.fy_px / lens.fy_px - 1));
  result.rms_px = solved->rms_px;
  return result;
}

}  // namespace

void PrintEventBoards(const SeedOptions& seeds, const std::string& only) {
  fmt::print(
      "\nlenses of an event camera of 1280x720 from board:circles,4x11,0.02 in {:.0f} s of events, "
      "up to 40 views\n{:34} {:>7} {:>9} {:>6}  {:>15}  {:>13}  {:>8} {:>9}\n",
      kWatchedS, "board", "solved", "found, %", "views", "focal length, %", "RMS, px", "blink, %",
      "flicker");
  for (const EventBoardCase& how : EventBoardCases()) {
    if (how.name.find(only) == std::string::npos) continue;
    const auto all = RunAll<EventBoardResult>(
        seeds.count, seeds.threads, [&](int i) { return Calibrate(how, seeds.first + i); });
    int solved = 0, pictures = 0, with_board = 0;
    std::vector<double> focal, rms, blink, flicker, views;
    for (const EventBoardResult& one : all) {
      pictures += one.pictures;
      with_board += one.with_board;
      views.push_back(one.views);
      if (!one.refused.empty()) {
        fmt::print("  refused: {}\n", one.refused);
        continue;
      }
      ++solved;
      focal.push_back(100 * one.focal_error);
      rms.push_back(one.rms_px);
      blink.push_back(100 * one.blink_error);
      flicker.push_back(one.flicker_hz);
      if (seeds.verbose) {
        fmt::print("  {} of {} pictures, {} views, focal length {:.3f} %, {:.3f} px\n",
                   one.with_board, one.pictures, one.views, 100 * one.focal_error, one.rms_px);
      }
    }
    if (focal.empty()) {
      fmt::print("{:34} {:3} of {}\n", how.name, solved, seeds.count);
      continue;
    }
    const auto most = [](const std::vector<double>& of) {
      return *std::max_element(of.begin(), of.end());
    };
    fmt::print(
        "{:34} {:3}/{:<3} {:9.0f} {:6.0f}  {:6.3f} {:6.3f}  {:6.3f} {:6.3f}  {:8.2f} {:9.1f}\n",
        how.name, solved, seeds.count, 100.0 * with_board / std::max(1, pictures),
        UpperMedian(views), UpperMedian(focal), most(focal), UpperMedian(rms), most(rms),
        most(blink), UpperMedian(flicker));
  }
  fmt::print("focal length and RMS: median and worst\n");
}

}  // namespace rigcal::accuracy
