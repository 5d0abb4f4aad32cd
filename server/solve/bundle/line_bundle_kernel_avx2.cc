// SPDX-License-Identifier: Apache-2.0
#define RIGCAL_KERNEL kernel_avx2
#define RIGCAL_KERNEL_NAME "avx2"
#include "server/solve/bundle/line_bundle_step.h"
