// SPDX-License-Identifier: Apache-2.0
#define RIGCAL_KERNEL evt3_kernel_avx512
#include "agent/event/evt3_blocks.h"
