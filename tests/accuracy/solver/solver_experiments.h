// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tests/accuracy/experiment.h"

namespace rigcal::accuracy {

// The solver on simulated observations, and on the real recording.
Experiment Clocks();
Experiment Consistency();
Experiment Crb();
Experiment Doctor();
Experiment Flight();
Experiment Halves();
Experiment Large();
Experiment LineDelays();
Experiment Monitor();
Experiment Origin();
Experiment Real();
Experiment Robustness();
Experiment Scale();
Experiment Sparse();
Experiment Starts();
Experiment Stated();
Experiment Triangulate();
Experiment UntilMm();

}  // namespace rigcal::accuracy
