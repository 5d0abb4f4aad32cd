// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/detecting_observation_source.h"
#include "agent/capture/event_observation_source.h"
#include "agent/capture/frame_source.h"
#include "agent/capture/genicam/aravis_options.h"
#include "agent/capture/metavision/metavision_options.h"
#include "agent/capture/observation_source.h"
#include "agent/capture/recorded/csv_observation_source.h"
#include "agent/capture/recorded/images_frame_source.h"
#include "agent/capture/recorded/raw_event_source.h"
#include "agent/capture/recorded/video_frame_source.h"
#include "agent/capture/simulated/simulated_event_source.h"
#include "agent/capture/simulated/simulated_frame_source.h"
#include "agent/capture/simulated/simulated_observation_source.h"
#include "agent/capture/source_options.h"
#include "common/config/agent_config.h"

namespace rigcal::agent {

// Where one camera's pictures come from, and how the wand is found in them.
struct FrameSourceSpec {
  std::variant<ImagesSourceOptions, VideoSourceOptions, SimulatedFrameSourceOptions,
               AravisSourceOptions>
      frames;
  DetectingOptions detecting;
};

// Where one camera's events come from, and how the wand is found in them.
struct EventSourceSpec {
  std::variant<RawSourceOptions, SimulatedEventSourceOptions, MetavisionSourceOptions> events;
  BlinkWandDetectorOptions detector;
};

// Where one camera's observations come from.
using SourceSpec =
    std::variant<CsvSourceOptions, SimulatedSourceOptions, FrameSourceSpec, EventSourceSpec>;

// Reads what a user types behind --source:
//
//   [NAME=]csv:PATH[;speed=max|FACTOR][;sigma=0.5][;centres=blob|sphere][;calibration=FILE]
//   [NAME=]sim:camera=INDEX[;<simulation options>][;speed=max|FACTOR]
//   [NAME=]sim:camera=INDEX;pixels=1[;<simulation options>][;<rendering options>][;speed=...]
//   [NAME=]images:FOLDER[;timestamps=FILE][;fps=RATE][;exposure=S][;calibration=FILE][;speed=...]
//   [NAME=]video:FILE, with the same options
//   [NAME=]aravis:DEVICE[;exposure=S][;gain=DB][;frame_rate=HZ][;trigger=...][;pixel_format=...]
//          [;ptp=1][;calibration=FILE][;...]
//   [NAME=]raw:FILE[;geometry=WxH][;clock=ID][;calibration=FILE][;speed=max|FACTOR]
//          [;rate=HZ][;trigger=rising|falling|middle|none][;trigger_channel=N][;band=SHARE]
//          [;time=s|us|ns][;columns=xypt][;...]     FILE is RAW, HDF5 or CSV
//   [NAME=]metavision:[serial=NUMBER][;biases=FILE][;sync=standalone|primary|secondary]
//          [;primary_delay=S][;clock=ID][;latency=S][;calibration=FILE][;rate=HZ][;...]
//
// raw: reads events of an event camera and tells where the wand is `rate` times a second (200
// unless a trigger is named, 10 to 1000), at external triggers, or both; sensors on one sync cable
// name one clock. metavision: is a live one, with the same options behind `rate`; biases: TOML as
// ReadEventCameraConfig. NAME is the path's stem, sim_INDEX, DEVICE or NUMBER unless given. csv,
// images, video and raw: FILE is the path with .yaml for its ending unless given; images, video and
// raw do with calibration=none. sigma in pixels. centres: what the file's centres are, the image's
// (blob) or the sphere's. Simulation and rendering options as in ParseSimulationOptions and
// ParseFrameRenderOptions, but the wand's speed only as `wand_speed`, since `speed` is the pace.
// speed: times the recorded pace, 1 unless given. Every source of pictures takes the detector's
// options too, see TakeDetectingOptions. Neither path nor FILE can hold a ';'.
//
// INVALID_ARGUMENT quotes the parts that are wrong and shows a right example.
absl::StatusOr<SourceSpec> ParseSourceSpec(std::string_view text);

// The same, where `options` go before what the text says.
absl::StatusOr<SourceSpec> ParseSourceSpec(std::string_view text,
                                           const std::vector<SourceOption>& options);

// The same from a [[camera]] of the configuration file, whose keys go before what its source says.
// INVALID_ARGUMENT begins with file and line.
absl::StatusOr<SourceSpec> ParseSourceSpec(const CameraConfig& camera);

// The camera's name within the rig.
const std::string& CameraNameOf(const SourceSpec& spec);
const std::string& CameraNameOf(const FrameSourceSpec& spec);

// The source itself; opens its files once to see that they are there. The message names the camera,
// the file and what to do.
absl::StatusOr<std::unique_ptr<ObservationSource>> CreateSource(const SourceSpec& spec);

// Its pictures alone.
absl::StatusOr<std::unique_ptr<FrameSource>> CreateFrameSource(const FrameSourceSpec& spec);

}  // namespace rigcal::agent
