// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/accuracy/detection/detection_experiment.h"

namespace rigcal::accuracy {

// Settings of camera and room while the ambient light increases; one curve of the figure.
struct AmbientLightCase {
  std::string name;
  double clutter = 0;      // FrameRenderOptions::clutter
  bool auto_gain = false;  // FrameRenderOptions::auto_gain
};

struct AmbientLightOptions {
  // Camera, wand and sensor; lux, clutter, auto_gain and the number of frames are ignored.
  DetectionOptions detection;
  std::vector<double> lux;  // ascending
  std::vector<AmbientLightCase> cases;
  int frames = 100;        // with a wand, of each case and lux
  int empty_frames = 100;  // without one
};

// The paper's rig with a wand 1.5 to 4 m away, thirteen levels of light from 10 to 5 000 lux: with
// and without moderate clutter, each with fixed gain and with the gain reduced before a sphere
// saturates.
AmbientLightOptions PaperAmbientLight();

struct AmbientLightPoint {
  AmbientLightCase setting;
  double lux = 0;
  double grey_per_cd_m2 = 0;  // of the camera at this setting (LightModel)
  DetectionSummary shown;     // frames with a wand
  DetectionSummary empty;     // frames without one

  // Share of the frames with a fully visible wand in which it was found; NaN if there are none.
  double Rate() const;
  int FalseWands() const { return shown.false_wands + empty.false_wands; }
};

// By case, then by lux.
std::vector<AmbientLightPoint> RunAmbientLight(const AmbientLightOptions& options);

// One line of column names, one for each point.
std::string AmbientLightCsv(const std::vector<AmbientLightPoint>& points);

}  // namespace rigcal::accuracy
