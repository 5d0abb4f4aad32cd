// SPDX-License-Identifier: Apache-2.0
#define RIGCAL_KERNEL kernel_avx512
#define RIGCAL_KERNEL_NAME "avx512"
#include "server/solve/bundle/line_bundle_step.h"
