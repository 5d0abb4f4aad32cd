// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/detection_experiments.h"
#include "tests/accuracy/experiment.h"
#include "tests/accuracy/paper/paper.h"
#include "tests/accuracy/solver/solver_experiments.h"

namespace rigcal::accuracy {

std::vector<Experiment> AllExperiments() {
  return {Crb(),
          Consistency(),
          Clocks(),
          Starts(),
          LineDelays(),
          Robustness(),
          Doctor(),
          Real(),
          Halves(),
          Large(),
          Sparse(),
          Monitor(),
          Flight(),
          UntilMm(),
          Stated(),
          Triangulate(),
          Origin(),
          Scale(),
          Detection(),
          DetectionScore(),
          DetectionValueExperiment(),
          FitWandScore(),
          LightCodeExperiment(),
          AmbientLight(),
          Boards(),
          EventDetection(),
          EventDisturbances(),
          EventLatency(),
          BlinkFrequency(),
          Paper()};
}

}  // namespace rigcal::accuracy
