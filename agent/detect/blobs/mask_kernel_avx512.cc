// SPDX-License-Identifier: Apache-2.0
#define RIGCAL_KERNEL mask_kernel_avx512
#include "agent/detect/blobs/mask_rows.h"
