// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "agent/detect/frame/wand_detector.h"
#include "common/camera/camera_description.h"
#include "common/simulation/frames/frame_render_options.h"
#include "common/target/target.h"
#include "tests/accuracy/detection/random_wand_pose.h"

namespace rigcal::accuracy {

// Single frames, each with a wand anywhere or without one.
struct DetectionOptions {
  CameraDescription camera;  // with intrinsics
  Target target;
  FrameRenderOptions render;
  RandomWandPoseOptions pose;
  agent::WandDetectorOptions detector;
  bool with_wand = true;
  double share_without_wand = 0;  // of the frames, even with with_wand
  // All LEDs blink by one clock, as those of one driver do; else each by its own. A frame whose
  // exposure falls mostly into the dark shows no wand that is lit (RoomFrame::lit).
  bool one_clock = false;
  bool cut_by_border = false;  // one sphere at least is, and its centre is in the image
  // Behind the wand instead of the wall, one for each room in turn; paths of image files.
  std::vector<std::string> photographs;
  int frames = 100;
  int frames_per_room = 25;  // each room has clutter of its own
  uint32_t seed = 1;
  int threads = 2;
};

// The camera of the paper's rig: 1280x1024 with barrel distortion; and its wand.
DetectionOptions PaperDetection();

}  // namespace rigcal::accuracy
