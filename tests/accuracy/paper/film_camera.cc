// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/paper/film_camera.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>

#include "agent/detect/event/blink_wand_detector.h"
#include "agent/detect/event_board/event_board_detector.h"
#include "agent/detect/frame/background_learner.h"
#include "agent/detect/frame/frame_detector.h"
#include "agent/detect/frame/wand_detector.h"
#include "agent/event/evt3_writer.h"
#include "common/board/board.h"
#include "common/simulation/events/event_board_scene.h"
#include "common/simulation/events/event_renderer.h"
#include "common/simulation/frames/board_renderer.h"
#include "common/simulation/frames/scene_renderer.h"
#include "common/simulation/world/random_stream.h"
#include "common/status/status_macros.h"
#include "tests/accuracy/detection/detection_value.h"

namespace rigcal::accuracy {
namespace {

constexpr uint64_t kFilmPurpose = 0x66696c6d;
constexpr double kExposureS = 0.002;  // one blink: LEDs give the same light in every frame
constexpr double kLedHz = 500.1;      // as an oscillator without a crystal has it: not as told
constexpr double kBackgroundS = 3;    // DetectingOptions::background_s
constexpr double kBoardBlurPx = 0.7, kBoardNoiseGrey = 2;
// Of a board that moves so many pixels during an exposure, as many pictures are averaged.
constexpr int kMostParts = 4;
constexpr int64_t kFilmSliceUs = 10'000;
// Of each pixel, as in docs/accuracy.md, boards before event cameras: less than of the wand's
// sensor. With more of it OpenCV takes minutes for a picture without a board.
constexpr double kEventBoardNoiseHz = 1;
constexpr double kEventBoardSigmaPx = 0.35;  // docs/accuracy.md, a print before an event camera

uint32_t SeedOf(const PaperScene& scene, const PaperRecordingOptions& options, int camera) {
  RandomStream random{options.seed, kFilmPurpose, static_cast<uint64_t>(scene.motion()),
                      static_cast<uint64_t>(camera)};
  return static_cast<uint32_t>(random.Bits());
}

// The office of the detection experiments, with this exposure.
absl::StatusOr<FrameRenderOptions> OfficeLight(uint32_t seed) {
  for (const DetectionCase& room : ValueRooms()) {
    if (room.name != "office") continue;
    DetectionOptions look;
    room.change(&look);
    look.render.led_grey *= look.render.exposure_s / kExposureS;  // more gain
    look.render.exposure_s = kExposureS;
    look.render.seed = seed;
    return look.render;
  }
  return absl::InternalError("the detection experiments have no room \"office\"");
}

Target BlinkingAsBuilt(Target wand) {
  wand.blink_hz = {kLedHz};
  return wand;
}

Observation Nothing(const PaperScene& scene, int camera, int frame) {
  Observation row;
  row.time_ns = scene.world().Observe(camera, frame).time_ns;
  row.markers.resize(static_cast<size_t>(scene.target().marker_count()));
  return row;
}

std::vector<SphereMotion> SpheresAt(const PaperScene& scene, const RigidTransform& cam_from_rig,
                                    double time_s) {
  // Differences over the exposure itself, as FrameRenderer has them.
  const double half_s = 0.5 * kExposureS;
  const WandPose poses[3] = {scene.PoseAt(time_s - half_s), scene.PoseAt(time_s),
                             scene.PoseAt(time_s + half_s)};
  std::vector<SphereMotion> spheres;
  for (const double position_m : scene.world().true_target().marker_positions_m) {
    const Eigen::Vector3d first = cam_from_rig * poses[0].At(position_m);
    const Eigen::Vector3d middle = cam_from_rig * poses[1].At(position_m);
    const Eigen::Vector3d last = cam_from_rig * poses[2].At(position_m);
    spheres.push_back(
        {middle, (last - first) / (2 * half_s), (last - 2 * middle + first) / (half_s * half_s)});
  }
  return spheres;
}

absl::StatusOr<std::vector<Observation>> FilmWand(const PaperScene& scene, int camera,
                                                  uint32_t seed) {
  const CameraDescription description = scene.DescriptionOf(camera);
  RIGCAL_ASSIGN_OR_RETURN(const FrameRenderOptions light, OfficeLight(seed));
  RIGCAL_ASSIGN_OR_RETURN(
      SceneRenderer renderer,
      SceneRenderer::Create(*description.intrinsics, description.image_size_px,
                            BlinkingAsBuilt(scene.world().true_target()), light));
  agent::WandDetectorOptions options;
  options.exposure_s = kExposureS;
  RIGCAL_ASSIGN_OR_RETURN(agent::WandDetector detector,
                          agent::WandDetector::Create(options, scene.target(), description));
  RIGCAL_ASSIGN_OR_RETURN(
      agent::BackgroundLearner background,
      agent::BackgroundLearner::Create(options.colour, description.image_size_px, kBackgroundS));
  detector.SetBackground(background.background());
  const RigidTransform cam_from_rig = scene.CamFromRig(camera);
  const Eigen::Vector3d up = cam_from_rig.rotation * Eigen::Vector3d::UnitZ();
  std::vector<uint8_t> pixels(renderer.buffer_size());
  const ImageSize size = description.image_size_px;
  const agent::ImageView image{pixels.data(), static_cast<int>(size.width),
                               static_cast<int>(size.height),
                               static_cast<ptrdiff_t>(size.width) * 3, agent::PixelFormat::kBgr8};
  std::vector<Observation> rows;
  for (int frame = 0; frame < scene.FrameCount(); ++frame) {
    const double time_s = scene.TimeS(camera, frame);
    SceneFrame shown;
    shown.seed = static_cast<uint64_t>(frame);
    shown.led_time_s = time_s;
    shown.up = up;
    shown.floor << up, up.dot(cam_from_rig.translation_m);
    shown.spheres = SpheresAt(scene, cam_from_rig, time_s);
    RIGCAL_RETURN_IF_ERROR(renderer.Render(shown, pixels).status());
    const int64_t time_ns = scene.world().Observe(camera, frame).time_ns;
    background.Look(image);
    RIGCAL_ASSIGN_OR_RETURN(const agent::Detection found, detector.Detect(image, time_ns, 0));
    background.Learn(image, found);
    rows.push_back(found.observation);
  }
  return rows;
}

// Takes slices of simulated events to the end of a motion.
template <typename Render, typename Take>
absl::Status PassEvents(double seconds, const Render& render, const Take& take) {
  agent::Evt3Writer writer;
  std::vector<SimulatedEvent> events;
  std::vector<SimulatedTrigger> triggers;
  std::vector<agent::CdEvent> run;
  std::vector<uint8_t> bytes;
  const auto end_us = static_cast<int64_t>(std::llround(1e6 * seconds));
  for (int64_t to_us = kFilmSliceUs; to_us <= end_us; to_us += kFilmSliceUs) {
    events.clear();
    triggers.clear();
    bytes.clear();
    RIGCAL_RETURN_IF_ERROR(render(to_us, &events, &triggers));
    size_t next = 0;
    const auto write_run = [&] {
      writer.Write(run, &bytes);
      run.clear();
    };
    const auto write_triggers = [&](int64_t until_us) {
      for (; next < triggers.size() && triggers[next].time_us <= until_us; ++next) {
        write_run();
        writer.Write(
            agent::TriggerEvent{
                .time_us = triggers[next].time_us, .channel = 0, .rising = triggers[next].rising},
            &bytes);
      }
    };
    for (const SimulatedEvent& event : events) {
      write_triggers(event.time_us);
      run.push_back({event.time_us, event.x, event.y, event.on});
    }
    write_run();
    write_triggers(to_us);
    writer.WriteTime(to_us, &bytes);
    RIGCAL_RETURN_IF_ERROR(take(to_us, bytes));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<Observation>> FilmWandEvents(const PaperScene& scene, int camera,
                                                        uint32_t seed) {
  const CameraDescription description = scene.DescriptionOf(camera);
  RIGCAL_ASSIGN_OR_RETURN(const FrameRenderOptions light, OfficeLight(seed));
  EventRenderOptions sensor;
  sensor.seed = seed;
  sensor.trigger_hz = kPaperTriggerHz;
  RIGCAL_ASSIGN_OR_RETURN(
      EventRenderer renderer,
      EventRenderer::Create(*description.intrinsics, description.image_size_px,
                            BlinkingAsBuilt(scene.world().true_target()), light, sensor));
  agent::BlinkWandDetectorOptions options;
  options.output.rate_hz = 0;
  options.output.trigger = agent::TriggerInstant::kRising;
  RIGCAL_ASSIGN_OR_RETURN(agent::BlinkWandDetector detector,
                          agent::BlinkWandDetector::Create(options, scene.target(), description,
                                                           agent::EventFormat::kEvt3, false));
  const RigidTransform cam_from_rig = scene.CamFromRig(camera);
  const WandPath path = [&](double time_s) -> std::optional<WandPose> {
    const WandPose wand = scene.PoseAt(time_s);
    return WandPose{cam_from_rig * wand.origin_m, cam_from_rig.rotation * wand.direction};
  };
  std::vector<agent::Detection> found;
  RIGCAL_RETURN_IF_ERROR(PassEvents(
      scene.world().options().duration_s,
      [&](int64_t to_us, auto* events, auto* triggers) {
        return renderer.Render(to_us, path, events, triggers);
      },
      [&](int64_t, const std::vector<uint8_t>& bytes) {
        detector.Take(bytes, &found);
        return absl::OkStatus();
      }));
  detector.Finish(&found);
  std::vector<Observation> rows;
  for (int frame = 0; frame < scene.FrameCount(); ++frame) {
    rows.push_back(Nothing(scene, camera, frame));
  }
  const int64_t origin_ns = scene.world().cameras()[static_cast<size_t>(camera)].clock_origin_ns;
  for (const agent::Detection& detection : found) {
    const Observation& row = detection.observation;
    const auto frame = std::llround(1e-9 * static_cast<double>(row.time_ns) * kPaperTriggerHz);
    if (row.VisibleCount() == 0 || frame < 0 || frame >= scene.FrameCount()) continue;
    rows[static_cast<size_t>(frame)] = row;
    rows[static_cast<size_t>(frame)].time_ns += origin_ns;
  }
  return rows;
}

RigidTransform CamFromBoard(const PaperScene& scene, int camera, double time_s) {
  const WandPose pose = scene.PoseAt(time_s);
  return scene.CamFromRig(camera) *
         RigidTransform{Eigen::Quaterniond(pose.rotation), pose.origin_m};
}

// Where the outermost points of a board are in the image; none of a board that shows its back or is
// outside of the image.
std::vector<Eigen::Vector2d> CornersInImage(const PaperScene& scene, const Board& board, int camera,
                                            double time_s) {
  if (!(scene.FacingCosine(camera, scene.PoseAt(time_s)) > 0)) return {};
  const CameraDescription description = scene.DescriptionOf(camera);
  const RigidTransform cam_from_board = CamFromBoard(scene, camera, time_s);
  std::vector<Eigen::Vector2d> corners;
  bool is_inside = false;
  for (const Eigen::Vector3d& point : board.Points()) {
    Eigen::Vector2d pixel;
    if (!ImageOf(*description.intrinsics, cam_from_board * point, &pixel)) return {};
    corners.push_back(pixel);
    is_inside = is_inside ||
                (pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < description.image_size_px.width &&
                 pixel.y() < description.image_size_px.height);
  }
  return is_inside ? corners : std::vector<Eigen::Vector2d>();
}

absl::StatusOr<std::vector<Observation>> FilmBoard(const PaperScene& scene, int camera, int step,
                                                   uint32_t seed) {
  const CameraDescription description = scene.DescriptionOf(camera);
  RIGCAL_ASSIGN_OR_RETURN(const Board board, ParseBoard(scene.target().board));
  const BoardRenderer renderer(*description.intrinsics, description.image_size_px);
  RIGCAL_ASSIGN_OR_RETURN(const auto detector,
                          agent::MakeFrameDetector({}, scene.target(), description));
  std::vector<Observation> rows;
  for (int frame = 0; frame < scene.FrameCount(); frame += step) {
    const double time_s = scene.TimeS(camera, frame);
    rows.push_back(Nothing(scene, camera, frame));
    const auto before = CornersInImage(scene, board, camera, time_s - 0.5 * kExposureS);
    const auto after = CornersInImage(scene, board, camera, time_s + 0.5 * kExposureS);
    if (before.empty() || after.empty()) continue;
    double moved_px = 0;
    for (size_t i = 0; i < before.size(); ++i) {
      moved_px = std::max(moved_px, (after[i] - before[i]).norm());
    }
    const int parts = std::clamp(static_cast<int>(std::ceil(2 * moved_px)), 1, kMostParts);
    const uint64_t picture = (uint64_t{seed} << 32) + static_cast<uint64_t>(frame);
    // The noise of one picture with the light of all.
    cv::Mat1f light;
    for (int part = 0; part < parts; ++part) {
      const double at_s = time_s + ((part + 0.5) / parts - 0.5) * kExposureS;
      const double noise = part == 0 ? kBoardNoiseGrey * parts : 0;
      const cv::Mat grey =
          renderer.Render(board, CamFromBoard(scene, camera, at_s), kBoardBlurPx, noise, picture);
      cv::Mat1f one;
      grey.convertTo(one, CV_32F, 1.0 / parts);
      light = part == 0 ? one : cv::Mat1f(light + one);
    }
    cv::Mat image;
    light.convertTo(image, CV_8U);
    const agent::ImageView view{image.data, image.cols, image.rows,
                                static_cast<ptrdiff_t>(image.step[0]), agent::PixelFormat::kMono8};
    RIGCAL_ASSIGN_OR_RETURN(const agent::Detection found,
                            detector->Detect(view, rows.back().time_ns, 0));
    rows.back() = found.observation;
  }
  return rows;
}

absl::StatusOr<std::vector<Observation>> FilmBoardEvents(const PaperScene& scene, int camera,
                                                         double most_angle_deg, uint32_t seed) {
  const double least_cosine = std::cos(most_angle_deg * std::numbers::pi / 180);
  RIGCAL_ASSIGN_OR_RETURN(const Board board, ParseBoard(scene.target().board));
  std::vector<Observation> rows;
  if (!board.HasCircles()) return rows;
  const CameraDescription description = scene.DescriptionOf(camera);
  const ImageSize size = description.image_size_px;
  EventBoardLight print;
  print.refresh_hz = 0;
  print.black = 0.04;
  EventRenderOptions sensor;
  sensor.seed = seed;
  sensor.background_hz = kEventBoardNoiseHz;
  // Its back is blank.
  const RigidTransform hidden{Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, -10)};
  EventBoardScene events_of(board, *description.intrinsics, size, print, sensor,
                            [&](double time_s) {
                              return CornersInImage(scene, board, camera, time_s).empty()
                                         ? hidden
                                         : CamFromBoard(scene, camera, time_s);
                            });
  agent::EventBoardDetector detector(board, {size.width, size.height}, agent::EventFormat::kEvt3,
                                     false);
  std::vector<agent::EventBoardPicture> pictures;
  RIGCAL_RETURN_IF_ERROR(PassEvents(
      scene.world().options().duration_s,
      [&](int64_t to_us, auto* events, auto*) {
        events_of.Render(to_us, events);
        return absl::OkStatus();
      },
      [&](int64_t to_us, const std::vector<uint8_t>& bytes) {
        // As with frames, what shows no board is not searched.
        const double time_s = 1e-6 * static_cast<double>(to_us);
        if (scene.FacingCosine(camera, scene.PoseAt(time_s)) < least_cosine ||
            CornersInImage(scene, board, camera, time_s).empty()) {
          return absl::OkStatus();
        }
        const absl::Status taken = detector.Take(bytes, &pictures);
        for (agent::EventBoardPicture& picture : pictures) picture.grey.release();
        return taken;
      }));
  RIGCAL_RETURN_IF_ERROR(detector.Finish(&pictures));
  const int64_t origin_ns = scene.world().cameras()[static_cast<size_t>(camera)].clock_origin_ns;
  for (const agent::EventBoardPicture& picture : pictures) {
    if (!picture.seen) continue;
    Observation& row = rows.emplace_back();
    row.time_ns = origin_ns + std::llround(1e3 * picture.time_us);
    for (const Eigen::Vector2d& pixel : picture.seen->pixels) {
      MarkerObservation& marker = row.markers.emplace_back();
      marker.visible = pixel.allFinite();
      if (!marker.visible) continue;
      marker.centre_px = pixel;
      marker.covariance_px2 = kEventBoardSigmaPx * kEventBoardSigmaPx * Eigen::Matrix2d::Identity();
    }
  }
  return rows;
}

}  // namespace

absl::StatusOr<std::vector<Observation>> FilmCamera(const PaperScene& scene,
                                                    const PaperRecordingOptions& options,
                                                    int camera) {
  const uint32_t seed = SeedOf(scene, options, camera);
  const bool is_event = PaperScene::IsEventCamera(camera);
  if (scene.IsBoard()) {
    return is_event ? FilmBoardEvents(scene, camera, options.board_angle_deg, seed)
                    : FilmBoard(scene, camera, BoardFrameStep(options), seed);
  }
  return is_event ? FilmWandEvents(scene, camera, seed) : FilmWand(scene, camera, seed);
}

}  // namespace rigcal::accuracy
