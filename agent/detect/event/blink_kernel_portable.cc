// SPDX-License-Identifier: Apache-2.0
#define RIGCAL_KERNEL blink_kernel_portable
#include "agent/detect/event/blink_update.h"
