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
Experiment LineDelays();
Experiment Monitor();
Experiment Real();
Experiment Robustness();
Experiment Sparse();
Experiment Starts();
Experiment UntilMm();

}  // namespace rigcal::accuracy
