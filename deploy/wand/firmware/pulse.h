// SPDX-License-Identifier: Apache-2.0
// The trigger's pulses, switched by the compare units of timer 1 at exact times.
#pragma once

#include <stdint.h>

enum { PULSE_MIN_HZ = 5, PULSE_MAX_HZ = 200, PULSE_MIN_US = 20, PULSE_LEAST_REST_US = 100 };

// Pulses of `hz` (in the range above) that are high for `width_us`: from PULSE_MIN_US to
// PULSE_LEAST_REST_US less than the period, rounded to ticks of 64 / F_CPU seconds (4 us at 16
// MHz). The period is off by at most 0.04 %; that of 50 Hz is exact.
void pulse_start(uint16_t hz, uint16_t width_us);

// Both outputs low.
void pulse_stop(void);
