// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/light_code_waves.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/capture/detecting_observation_source.h"
#include "agent/capture/event_observation_source.h"
#include "agent/capture/simulated/simulated_event_source.h"
#include "agent/capture/simulated/simulated_frame_source.h"
#include "common/options/option_table.h"
#include "common/simulation/world/random_stream.h"
#include "common/status/status_macros.h"
#include "server/associate/align_clocks.h"
#include "server/solve/calibrate.h"
#include "tests/accuracy/detection/paper_rig.h"
#include "tests/accuracy/seed_runs.h"

namespace rigcal::accuracy {
namespace {

constexpr double kDayS = 86'400;

// The world of a seed, and the light of its wand.
struct Scene {
  SimulationOptions world;
  FrameRenderOptions render;
};

absl::StatusOr<Scene> SceneOf(const LightCodeOptions& options, LightCodeWave* wave) {
  RandomStream random{wave->seed, 54};
  Scene scene;
  scene.world.seed = wave->seed;
  scene.world.camera_count = options.frame_cameras + options.event_cameras;
  scene.world.duration_s = options.duration_s;
  scene.world.free_running = true;
  for (int c = 0; c < scene.world.camera_count; ++c) {
    scene.world.time_offset_s[c] = -kDayS * random.Uniform();
    scene.world.time_rate_ppm[c] = random.Uniform(-50, 50);
    scene.world.camera_rate_hz[c] = c < options.frame_cameras ? random.Uniform(24, 120) : 200;
  }
  wave->wand = 1 + static_cast<uint32_t>(random.Uniform(0, kMaxWandNumber));
  if (wave->seed % 5 == 0) wave->wand_rate = 1 + random.Uniform(-0.02, 0.02);
  scene.render.light_code = static_cast<int>(wave->wand);
  scene.render.wand_on_s = kDayS * random.Uniform();
  scene.render.blink_drift_ppm = 1e6 * (wave->wand_rate - 1);
  OptionTable table;
  AddOptions(&scene.render, &table);
  FaultList faults;
  if (!options.room.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(const auto given, SplitOptionList(options.room));
    table.Read(given, &faults);
  }
  faults.Add(scene.render.Validate());
  RIGCAL_RETURN_IF_ERROR(faults.Result("--room: "));
  return scene;
}

absl::StatusOr<std::unique_ptr<agent::ObservationSource>> SourceOf(const LightCodeOptions& options,
                                                                   const Scene& scene, int camera) {
  agent::SimulatedCameraOptions common;
  common.camera = absl::StrCat("camera_", camera);
  common.camera_index = camera;
  common.simulation = scene.world;
  common.speed = agent::kMaxSpeed;
  if (camera < options.frame_cameras) {
    agent::SimulatedFrameSourceOptions of_frames;
    static_cast<agent::SimulatedCameraOptions&>(of_frames) = common;
    of_frames.rendering = scene.render;
    RIGCAL_ASSIGN_OR_RETURN(auto frames, agent::SimulatedFrameSource::Create(of_frames));
    agent::DetectingOptions detecting;
    detecting.detector.exposure_s = scene.render.exposure_s;
    return agent::DetectingObservationSource::Create(std::move(frames), detecting);
  }
  agent::SimulatedEventSourceOptions of_events;
  static_cast<agent::SimulatedCameraOptions&>(of_events) = common;
  of_events.scene = scene.render;
  RIGCAL_ASSIGN_OR_RETURN(auto events, agent::SimulatedEventSource::Create(of_events));
  return std::make_unique<agent::EventObservationSource>(std::move(events),
                                                         agent::BlinkWandDetectorOptions());
}

absl::StatusOr<server::CameraTrack> Watch(agent::ObservationSource* source, const Target& target) {
  server::CameraTrack track;
  track.session_id = "wave";
  track.camera = source->description();
  RIGCAL_RETURN_IF_ERROR(source->Start(target));
  while (true) {
    RIGCAL_ASSIGN_OR_RETURN(std::optional<Observation> row, source->Next());
    if (!row) return track;
    for (const ClockSample& sample : source->TakeClockSamples()) {
      track.clock_samples.push_back({row->clock_epoch, sample});
    }
    track.observations.push_back(*std::move(row));
  }
}

// A camera's time offset as the world has it, at a moment of its clock.
double TrueOffsetS(const SimulatedCamera& camera, double camera_s) {
  return camera.time_offset_s + 1e-6 * camera.time_rate_ppm *
                                    (camera_s - 1e-9 * static_cast<double>(camera.clock_origin_ns));
}

// Largest difference of the errors of any two cameras.
double Spread(const std::vector<double>& errors) {
  const auto [least, most] = std::ranges::minmax_element(errors);
  return *most - *least;
}

void JudgeReadings(const SimulatedWorld& world, const Scene& scene,
                   const std::vector<server::CameraTrack>& tracks, LightCodeWave* wave) {
  for (size_t c = 0; c < tracks.size(); ++c) {
    const SimulatedCamera& camera = world.cameras()[c];
    bool read = false, wrong = false;
    for (const auto& epoch_sample : tracks[c].clock_samples) {
      const ClockSample& sample = epoch_sample.sample;
      if (!sample.IsOfWand()) continue;
      const double device_s = 1e-9 * static_cast<double>(sample.device_ns);
      const double rig_s = device_s - 1e-9 * static_cast<double>(camera.clock_origin_ns) +
                           TrueOffsetS(camera, device_s);
      const double wand_s = scene.render.wand_on_s + wave->wand_rate * rig_s;
      const double error_s = 1e-9 * static_cast<double>(sample.light_ns) - wand_s;
      wrong |= sample.light != wave->wand || std::abs(error_s) > 1 / camera.rate_hz;
      // Of a window of at most 12 s, the middle is given.
      if (!read) wave->read_after_s = std::max(wave->read_after_s, 2 * rig_s);
      read = true;
    }
    ++wave->cameras;
    wave->read += read ? 1 : 0;
    wave->wrong += wrong ? 1 : 0;
  }
}

// By the code alone, as the solve begins.
void JudgeAlignment(const SimulatedWorld& world, const std::vector<server::CameraTrack>& tracks,
                    LightCodeWave* wave) {
  std::vector<server::CameraTrack> rows = tracks;
  RefusalCounter refused;
  const auto aligned = server::AlignClocks(
      tracks, server::CleanTracks(&rows, world.target().marker_count(), &refused), &refused);
  std::vector<std::pair<double, double>> errors;  // with the time of a frame
  for (const server::AlignedTrack& track : aligned) {
    if (track.wand == 0) continue;
    for (size_t c = 0; c < tracks.size(); ++c) {
      if (tracks[c].camera.camera != track.track.camera.camera) continue;
      const SimulatedCamera& camera = world.cameras()[c];
      const double middle_s = 1e-9 * static_cast<double>(track.track.observations.time_ns(
                                         track.track.observations.size() / 2));
      errors.emplace_back(
          1e-9 * static_cast<double>(track.clock_offset_ns) - TrueOffsetS(camera, middle_s),
          1 / camera.rate_hz);
    }
  }
  if (errors.size() < 2) return;
  for (const auto& [error_a_s, frame_a_s] : errors) {
    for (const auto& [error_b_s, frame_b_s] : errors) {
      const double apart_s = std::abs(error_a_s - error_b_s);
      wave->coarse_s = std::max(wave->coarse_s, apart_s);
      wave->coarse_frames = std::max(wave->coarse_frames, apart_s / std::max(frame_a_s, frame_b_s));
    }
  }
}

void JudgeSolve(const SimulatedWorld& world, size_t frame_cameras,
                std::vector<server::CameraTrack> tracks, LightCodeWave* wave) {
  const server::CalibrationOutcome outcome =
      server::Calibrate({.target = world.target(), .tracks = std::move(tracks), .refused = {}}, {});
  wave->solved = outcome.result.status();
  if (!outcome.result.ok()) return;
  std::vector<double> errors_s, of_frames_s;
  for (const CalibratedCamera& camera : outcome.result->cameras) {
    for (size_t c = 0; c < world.cameras().size(); ++c) {
      if (camera.camera != absl::StrCat("camera_", c)) continue;
      const double error_s =
          camera.time_offset_s - TrueOffsetS(world.cameras()[c], camera.time_epoch_s);
      errors_s.push_back(error_s);
      if (c < frame_cameras) of_frames_s.push_back(error_s);
    }
  }
  if (errors_s.size() != world.cameras().size()) return;
  wave->solved_s = Spread(of_frames_s);
  wave->solved_events_s = Spread(errors_s);
}

absl::Status RunWave(const LightCodeOptions& options, LightCodeWave* wave) {
  RIGCAL_ASSIGN_OR_RETURN(const Scene scene, SceneOf(options, wave));
  const Target target = PaperWand();
  RIGCAL_ASSIGN_OR_RETURN(const auto world, agent::SharedWorld(scene.world, target));
  std::vector<server::CameraTrack> tracks;
  for (int c = 0; c < scene.world.camera_count; ++c) {
    RIGCAL_ASSIGN_OR_RETURN(const auto source, SourceOf(options, scene, c));
    RIGCAL_ASSIGN_OR_RETURN(server::CameraTrack track, Watch(source.get(), target));
    tracks.push_back(std::move(track));
  }
  JudgeReadings(*world, scene, tracks, wave);
  JudgeAlignment(*world, tracks, wave);
  JudgeSolve(*world, static_cast<size_t>(options.frame_cameras), std::move(tracks), wave);
  return absl::OkStatus();
}

}  // namespace

std::vector<LightCodeWave> RunLightCode(const LightCodeOptions& options) {
  return RunAll<LightCodeWave>(options.seeds, options.threads, [&](int i) {
    LightCodeWave wave;
    wave.seed = static_cast<uint32_t>(options.first_seed + i);
    wave.status = RunWave(options, &wave);
    return wave;
  });
}

}  // namespace rigcal::accuracy
