// SPDX-License-Identifier: Apache-2.0
// A slow clock for button, status LED and battery. Each program counts it with a timer of its own.
#pragma once

#include <stdint.h>

enum { TICKS_PER_SECOND = 31 };  // 30.5, to be exact: a tick has 32.8 ms

// Called every 32.8 ms by an interrupt.
void ticks_add(void);
// Ticks since the start, modulo 65536.
uint16_t ticks_now(void);
