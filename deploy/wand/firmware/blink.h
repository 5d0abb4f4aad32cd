// SPDX-License-Identifier: Apache-2.0
// The three LEDs blink. Compare units of timers switch them at exact times; interrupts only tell
// the units when the next switch is due, so that a late interrupt moves no light.
#pragma once

#include <stdint.h>

enum { BLINK_LEDS = 3, BLINK_MIN_HZ = 100, BLINK_MAX_HZ = 1000 };
enum { BLINK_MIN_DUTY = 5, BLINK_MAX_DUTY = 95 };

// All LEDs rise together, and go on from there with their own frequencies. `hz` and `duty_pct` (the
// share of a period in which an LED is lit) are within the ranges above. A period is a whole number
// of ticks of 8 / F_CPU seconds: at 16 MHz it is off by at most 0.025 %.
void blink_start(const uint16_t hz[BLINK_LEDS], uint8_t duty_pct);

// All LEDs dark. Timer 1 runs after either call, and its overflow interrupts every 65536 ticks.
void blink_stop(void);
