// SPDX-License-Identifier: Apache-2.0
// The board's own LED, which the person with the wand sees.
#pragma once

#include <stdint.h>

enum status { STATUS_OFF, STATUS_GOOD, STATUS_LOW, STATUS_EMPTY };

void status_led_start(void);
// Good: lit. Low: two flashes a second. Empty: a short flash every two seconds. Off: dark.
void status_led_set(enum status status);
// Flashes `count` times, after a pause, then shows the status again: answers a press of the button.
void status_led_count(uint8_t count);
// Called once a tick.
void status_led_tick(void);
