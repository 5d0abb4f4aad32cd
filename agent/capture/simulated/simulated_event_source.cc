// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/simulated/simulated_event_source.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/board/board.h"
#include "common/simulation/frames/held_board.h"

namespace rigcal::agent {
namespace {

constexpr int64_t kSliceUs = 2 * EventRenderer::kCellUs;
constexpr uint32_t kWidthPx = 1280, kHeightPx = 720;
constexpr double kPlaceS = 1, kRestShare = 0.6;  // of a board that is held, at each place
// Reflected by its screen, of the light of its white: a room with its lamps on.
constexpr double kScreenAmbient = 0.3;

// Of the frame camera that could stand there.
Intrinsics EventLens(const Intrinsics& lens, const ImageSize& size) {
  const double scale = static_cast<double>(kHeightPx) / size.height;
  Intrinsics scaled = lens;
  scaled.fx_px *= scale;
  scaled.fy_px *= scale;
  scaled.cx_px = 0.5 * (kWidthPx - 1.0) + scale * (lens.cx_px - 0.5 * (size.width - 1.0));
  scaled.cy_px = 0.5 * (kHeightPx - 1.0) + scale * (lens.cy_px - 0.5 * (size.height - 1.0));
  return scaled;
}

}  // namespace

void AddOptions(SimulatedEventSourceOptions* options, OptionTable* table) {
  AddOptions(static_cast<SimulatedCameraOptions*>(options), table);
  AddNear(&options->held_before, table);
  AddOptions(&options->scene, table);
  AddOptions(&options->rendering, table);
  table->Add("clock", &options->clock_id, "NAME", "shared by sensors on one sync cable");
}

absl::Status SimulatedEventSourceOptions::Validate() const {
  FaultList faults;
  faults.Add(scene.Validate());
  faults.Add(rendering.Validate());
  return SimulatedCameraOptions::Validate(std::move(faults));
}

absl::StatusOr<std::unique_ptr<SimulatedEventSource>> SimulatedEventSource::Create(
    SimulatedEventSourceOptions options) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  RIGCAL_ASSIGN_OR_RETURN(CameraDescription description, DescribeSimulatedCamera(options));
  absl::StrAppend(&description.source, ";events=1");
  description.sensor = SensorKind::kEvent;
  description.intrinsics = EventLens(*description.intrinsics, description.image_size_px);
  description.image_size_px = {kWidthPx, kHeightPx};
  RIGCAL_RETURN_IF_ERROR(DescribeLens(options, &description));
  if (!options.clock_id.empty()) description.clock.clock_id = options.clock_id;
  RIGCAL_RETURN_IF_ERROR(description.Validate());
  return std::make_unique<SimulatedEventSource>(std::move(options), std::move(description));
}

absl::Status SimulatedEventSource::Start(const Target& target) {
  renderer_.reset();
  board_.reset();
  writer_ = {};
  byte_offset_ = 0;
  next_sample_ = 0;
  if (!target.board.empty()) return StartBoard(target);
  RIGCAL_RETURN_IF_ERROR(CheckIsLine(target));
  RIGCAL_RETURN_IF_ERROR(StartWorld(target));
  const SimulatedCamera& camera = Camera();
  FrameRenderOptions scene = options_.scene;
  EventRenderOptions rendering = options_.rendering;
  // Each camera looks at another wall and has noise of its own.
  scene.seed = scene.seed * 1009 + static_cast<uint32_t>(options_.camera_index);
  rendering.seed = rendering.seed * 1013 + static_cast<uint32_t>(options_.camera_index);
  RIGCAL_ASSIGN_OR_RETURN(
      renderer_,
      EventRenderer::Create(EventLens(camera.true_intrinsics, camera.description.image_size_px),
                            description_.image_size_px, world_->true_target(), scene, rendering));
  return absl::OkStatus();
}

absl::Status SimulatedEventSource::StartBoard(const Target& target) {
  RIGCAL_ASSIGN_OR_RETURN(const Board board, ParseBoard(target.board));
  if (!board.HasCircles() || !options_.held_before) {
    return absl::FailedPreconditionError(absl::StrCat(
        "camera ", options_.camera,
        ": a simulated event camera shows boards of circles that are held before it (near=1), not ",
        target.board));
  }
  // The world gives the time alone.
  RIGCAL_ASSIGN_OR_RETURN(const Target any, ParseTarget("point"));
  RIGCAL_RETURN_IF_ERROR(StartWorld(any));
  const SimulatedCamera& camera = Camera();
  const Intrinsics lens = EventLens(camera.true_intrinsics, camera.description.image_size_px);
  const auto seed = options_.simulation.seed + static_cast<uint32_t>(options_.camera_index);
  std::vector<RigidTransform> poses;
  for (double time_s = 0; time_s < options_.simulation.duration_s + 2 * kPlaceS;
       time_s += kPlaceS) {
    poses.push_back(HeldBoard(board, lens, description_.image_size_px, time_s, seed));
  }
  EventRenderOptions rendering = options_.rendering;
  rendering.seed = rendering.seed * 1013 + static_cast<uint32_t>(options_.camera_index);
  EventBoardLight light;
  light.ambient = kScreenAmbient;
  board_.emplace(board, lens, description_.image_size_px, light, rendering,
                 HandHeld(std::move(poses), kPlaceS, kRestShare));
  board_us_ = 0;
  return absl::OkStatus();
}

std::vector<MarkerGroundTruth> SimulatedEventSource::TruthAt(int64_t time_us) const {
  const SimulatedCamera& camera = Camera();
  const double camera_time_s =
      1e-6 * static_cast<double>(time_us) - 1e-9 * static_cast<double>(camera.clock_origin_ns);
  const auto wand =
      WandInCamera(camera_time_s * (1 + 1e-6 * camera.time_rate_ppm) + camera.time_offset_s);
  return wand ? renderer_->TruthOf(*wand) : std::vector<MarkerGroundTruth>();
}

std::optional<WandPose> SimulatedEventSource::WandInCamera(double rig_time_s) const {
  if (world_->options().InGap(rig_time_s)) return std::nullopt;
  const RigidTransform& cam_from_rig = Camera().cam_from_rig;
  const WandPose wand = world_->WandAt(rig_time_s);
  return WandPose{cam_from_rig * wand.origin_m, cam_from_rig.rotation * wand.direction};
}

int64_t SimulatedEventSource::StampUs(int64_t rig_time_us) const {
  const SimulatedCamera& camera = Camera();
  const double camera_time_s = (1e-6 * static_cast<double>(rig_time_us) - camera.time_offset_s) /
                               (1 + 1e-6 * camera.time_rate_ppm);
  return std::max<int64_t>(0, std::llround(1e6 * camera_time_s) + camera.clock_origin_ns / 1000);
}

void SimulatedEventSource::Encode() {
  byte_offset_ += bytes_.size();
  bytes_.clear();
  run_.clear();
  size_t trigger = 0;
  const auto write_triggers = [&](int64_t until_us) {
    for (; trigger < triggers_.size() && triggers_[trigger].time_us <= until_us; ++trigger) {
      writer_.Write(TriggerEvent{.time_us = StampUs(triggers_[trigger].time_us),
                                 .channel = 0,
                                 .rising = triggers_[trigger].rising},
                    &bytes_);
    }
  };
  // Many events have one time.
  int64_t time_us = -1, stamp_us = 0;
  for (const SimulatedEvent& event : events_) {
    if (event.time_us != time_us) {
      time_us = event.time_us;
      stamp_us = StampUs(time_us);
      if (trigger < triggers_.size() && triggers_[trigger].time_us <= time_us) {
        writer_.Write(run_, &bytes_);
        run_.clear();
        write_triggers(time_us);
      }
    }
    run_.push_back({stamp_us, event.x, event.y, event.on});
  }
  writer_.Write(run_, &bytes_);
  write_triggers(now_us());
  writer_.WriteTime(StampUs(now_us()), &bytes_);
}

absl::StatusOr<std::optional<EventChunk>> SimulatedEventSource::Next() {
  if (!renderer_ && !board_) return std::nullopt;
  const int64_t end_us = now_us() + kSliceUs;
  if (1e-6 * static_cast<double>(end_us) > world_->options().duration_s) return std::nullopt;
  events_.clear();
  triggers_.clear();
  if (board_) {
    board_->Render(end_us, &events_);
    board_us_ = end_us;
  } else {
    RIGCAL_RETURN_IF_ERROR(renderer_->Render(
        end_us, [this](double time_s) { return WandInCamera(time_s); }, &events_, &triggers_));
  }
  Encode();
  if (!pacer_.Wait(1000 * StampUs(end_us))) return std::nullopt;
  const SimulatedCamera& camera = Camera();
  if (options_.simulation.clock_samples && end_us >= 1'000'000 * next_sample_) {
    const int frame = std::min(world_->FrameCount(options_.camera_index) - 1,
                               static_cast<int>(std::lround(camera.rate_hz * next_sample_)));
    SampleClock(frame);
    ++next_sample_;
  }
  return EventChunk{.format = EventFormat::kEvt3, .bytes = bytes_, .byte_offset = byte_offset_};
}

}  // namespace rigcal::agent
