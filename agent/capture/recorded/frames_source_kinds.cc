// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/frame_source_spec.h"
#include "agent/capture/recorded/images_frame_source.h"
#include "agent/capture/recorded/video_frame_source.h"

namespace rigcal::agent {

void ResolveOptions(const std::string& name, const std::string& subject,
                    RecordedFramesOptions* options) {
  options->path = subject;
  options->camera = CameraNameOf(name, subject);
  ResolveCalibration(subject, &options->calibration_path);
}

extern const SourceKind kImagesSource;
constinit const SourceKind kImagesSource = {
    .name = "images",
    .selector = "",
    .subject = "FOLDER",
    .subject_is_path = true,
    .required = "",
    .summary = "recorded frames: the image files of a folder, or one image",
    .example = "left=images:rig/left;fps=25;hue_max=40",
    .make = MakeSpec<SpecOf<FrameSourceSpec, ImagesFrameSource, RecordedFramesOptions>>};

extern const SourceKind kVideoSource;
constinit const SourceKind kVideoSource = {
    .name = "video",
    .selector = "",
    .subject = "FILE",
    .subject_is_path = true,
    .required = "",
    .summary = "recorded frames: a video that FFmpeg or GStreamer can read",
    .example = "left=video:rig/left.mkv;speed=max",
    .make = MakeSpec<SpecOf<FrameSourceSpec, VideoFrameSource, RecordedFramesOptions>>};

}  // namespace rigcal::agent
