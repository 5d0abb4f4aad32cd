// SPDX-License-Identifier: Apache-2.0
#include "ticks.h"

#include <util/atomic.h>

static volatile uint16_t ticks;

void ticks_add(void) { ++ticks; }

uint16_t ticks_now(void) {
  uint16_t now;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { now = ticks; }
  return now;
}
