// SPDX-License-Identifier: Apache-2.0
#define RIGCAL_KERNEL kernel_baseline
#define RIGCAL_KERNEL_NAME "baseline"
#include "server/solve/bundle/line_bundle_step.h"
