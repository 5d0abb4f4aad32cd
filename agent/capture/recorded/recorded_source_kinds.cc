// SPDX-License-Identifier: Apache-2.0
#include <utility>
#include <vector>

#include "agent/capture/event_source_spec.h"
#include "agent/capture/frame_source_spec.h"
#include "agent/capture/recorded/csv_observation_source.h"
#include "agent/capture/recorded/images_frame_source.h"
#include "agent/capture/recorded/raw_event_source.h"
#include "agent/capture/recorded/video_frame_source.h"
#include "agent/event_files/sensor_geometry.h"

namespace rigcal::agent {

void AddOptions(CsvSourceOptions* options, OptionTable* table) {
  AddOptions(static_cast<RecordingOptions*>(options), table);
  table->Add("sigma", &options->sigma_px, {kAboveZero, kNoLimit, "px"},
             "one sigma of each coordinate of a centre");
  table->AddChoice("centres", &options->centre_kind,
                   std::vector<std::pair<std::string, CentreKind>>{
                       {"blob", CentreKind::kImageBlob}, {"sphere", CentreKind::kSphereCentre}},
                   "what the centres are: of the image blob, or of the projected sphere");
  table->Add("exposure", &options->exposure_s, {0, 10, "s"}, "of every frame; 0: not known");
  AddStamps(&options->stamps, table);
}

void AddOptions(RecordedFramesOptions* options, OptionTable* table) {
  AddOptions(static_cast<RecordingOptions*>(options), table);
  table->AddPath("timestamps", &options->timestamps_path,
                 "times of the frames: name;timestamp_ns, or one timestamp_ns per line for video");
  table->Add("fps", &options->fps, {kAboveZero, 1e6, "Hz"},
             "frame rate, if the recording has no times");
  table->Add("exposure", &options->exposure_s, {0, 10, "s"}, "of every frame; 0: not known");
  table->Add("bits", &options->bits, {8, 16},
             "of a pixel where a file has room for 16: 12 for a camera of 12 bits");
  AddStamps(&options->stamps, table);
}

void AddOptions(RawSourceOptions* options, OptionTable* table) {
  AddOptions(static_cast<RecordingOptions*>(options), table);
  AddGeometry(&options->geometry, table);
  table->Add("clock", &options->clock_id, "NAME", "shared by sensors on one sync cable");
  AddOptions(&options->plain, table);
}

extern constinit const SourceKind kCsvSource = {
    .name = "csv",
    .subject = "PATH",
    .subject_is_path = true,
    .summary = "recorded marker centres, a CSV line for each observation",
    .example = "left=csv:rig/left.csv;speed=max;sigma=0.5",
    .make = MakeSpec<SpecOf<DirectSourceSpec, CsvObservationSource, CsvSourceOptions>>};

extern constinit const SourceKind kImagesSource = {
    .name = "images",
    .subject = "FOLDER",
    .subject_is_path = true,
    .summary = "recorded frames: the image files of a folder, or one image",
    .example = "left=images:rig/left;fps=25;hue_max=40",
    .make = MakeSpec<SpecOf<FrameSourceSpec, ImagesFrameSource, RecordedFramesOptions>>};

extern constinit const SourceKind kVideoSource = {
    .name = "video",
    .subject = "FILE",
    .subject_is_path = true,
    .summary = "recorded frames: a video that FFmpeg or GStreamer can read",
    .example = "left=video:rig/left.mkv;speed=max",
    .make = MakeSpec<SpecOf<FrameSourceSpec, VideoFrameSource, RecordedFramesOptions>>};

extern constinit const SourceKind kRawSource = {
    .name = "raw",
    .subject = "FILE",
    .subject_is_path = true,
    .summary = "recorded events: RAW (EVT 2.0, 2.1, 3.0), HDF5 or CSV",
    .example = "left=raw:rig/left.raw;rate=200;trigger=rising",
    .make = MakeSpec<SpecOf<EventSourceSpec, RawEventSource, RawSourceOptions>>};

}  // namespace rigcal::agent
