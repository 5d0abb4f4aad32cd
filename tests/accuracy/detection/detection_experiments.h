// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tests/accuracy/experiment.h"

namespace rigcal::accuracy {

// The detectors on rendered frames and on rendered event streams.
Experiment AmbientLight();
Experiment BlinkFrequency();
Experiment Boards();
Experiment Detection();
Experiment DetectionScore();
Experiment DetectionValueExperiment();
Experiment EventDetection();
Experiment EventDisturbances();
Experiment EventLatency();
Experiment FitWandScore();
Experiment LightCodeExperiment();

}  // namespace rigcal::accuracy
