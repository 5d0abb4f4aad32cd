// SPDX-License-Identifier: Apache-2.0
// Brightness of all LEDs: their common path to ground is switched at F_CPU / 256 (62.5 kHz).
#pragma once

#include <stdint.h>

enum { DIMMER_MIN = 10, DIMMER_MAX = 100 };

// `percent` is within the range above; at 100 the path stays closed and nothing is switched.
void dimmer_set(uint8_t percent);
