// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tests/accuracy/experiment.h"

namespace rigcal::accuracy {

// The tables of the eWand paper.
Experiment Paper();

}  // namespace rigcal::accuracy
