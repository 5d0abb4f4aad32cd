// SPDX-License-Identifier: Apache-2.0
// The three LEDs blink. Compare units of timers switch them at exact times; interrupts only tell
// the units when the next switch is due, so that a late interrupt moves no light.
#pragma once

#include <stdint.h>

enum { BLINK_LEDS = 3, BLINK_MIN_HZ = 100, BLINK_MAX_HZ = 1000 };
enum { BLINK_MIN_DUTY = 5, BLINK_MAX_DUTY = 95 };
// With a light code: what a bit cuts off leaves light, and what it leaves is darker.
enum { BLINK_CODE_MIN_DUTY = 40, BLINK_CODE_MAX_DUTY = 80 };

// All LEDs rise together, and go on from there with their own frequencies. `hz` and `duty_pct` (the
// share of a period in which an LED is lit) are within the ranges above. A period is a whole number
// of ticks of 8 / F_CPU seconds: at 16 MHz it is off by at most 0.025 %.
//
// `code` is a number of light_code.h. Bit k of it (from 0 on) is due from k x 100 ms to
// (k + 1) x 100 ms after the start. In each period of LED 2 that begins while a bit 1 is due, LED 2
// rises a tenth of the period later and falls a tenth earlier: at a duty of 50 % it gives 0.6 times
// the light, around the same moment. A bit 0, and all other LEDs, are as without a code.
void blink_start(const uint16_t hz[BLINK_LEDS], uint8_t duty_pct, uint8_t code);

// All LEDs dark. Timer 1 runs after either call, and its overflow interrupts every 65536 ticks.
void blink_stop(void);
