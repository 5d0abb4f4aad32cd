// SPDX-License-Identifier: Apache-2.0
// The battery, of whose voltage A0 sees half by two equal resistors.
#pragma once

#include <stdint.h>

// Low: charge it soon. Empty: the spheres are to go dark, so that it is not discharged too far and
// nobody records a wand that fades.
enum battery_state { BATTERY_GOOD, BATTERY_LOW, BATTERY_EMPTY };

// Measures the battery (2 ms). Low below `low_mv`, empty 200 mV below that; one that recovers
// without load counts as better from 100 mV above the one limit and 400 mV above the other.
// `low_mv` 0: always good.
void battery_look(uint16_t low_mv);

// Of the last look.
enum battery_state battery_state(void);
uint16_t battery_mv(void);  // twice the voltage at A0, against the board's 5 V: up to 10 000
