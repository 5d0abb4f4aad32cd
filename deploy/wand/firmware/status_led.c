// SPDX-License-Identifier: Apache-2.0
#include "status_led.h"

#include <stdbool.h>

#include "pins.h"

enum { FLASH = 8, EMPTY_PERIOD = 62, LOW_PERIOD = 16 };  // ticks

static enum status shown;
static uint8_t phase;
static uint8_t count_left;  // ticks of a count that is shown: a pause, then flash and pause in turn

void status_led_start(void) { STATUS_DDR |= _BV(STATUS_BIT); }

void status_led_set(enum status status) { shown = status; }

void status_led_count(uint8_t count) { count_left = (uint8_t)(2 * FLASH * (count + 1)); }

static bool is_lit(void) {
  if (count_left > 0) {
    --count_left;
    return count_left >= FLASH && (count_left / FLASH) % 2 == 0;
  }
  switch (shown) {
    case STATUS_GOOD:
      return true;
    case STATUS_LOW:
      return phase % LOW_PERIOD < LOW_PERIOD / 2;
    case STATUS_EMPTY:
      return phase < 2;
    case STATUS_OFF:
      break;
  }
  return false;
}

void status_led_tick(void) {
  phase = (uint8_t)((phase + 1) % EMPTY_PERIOD);
  if (is_lit()) {
    STATUS_PORT |= _BV(STATUS_BIT);
  } else {
    STATUS_PORT &= (uint8_t)~_BV(STATUS_BIT);
  }
}
