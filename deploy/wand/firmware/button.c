// SPDX-License-Identifier: Apache-2.0
#include "button.h"

#include "pins.h"
#include "ticks.h"

void button_start(void) { BUTTON_PORT |= _BV(BUTTON_BIT); }  // pull-up

enum button_event button_look(void) {
  static uint8_t held;  // ticks; stays at its end while a long press goes on
  if (BUTTON_PIN & _BV(BUTTON_BIT)) {
    const uint8_t was_held = held;
    held = 0;
    return was_held > 0 && was_held < TICKS_PER_SECOND ? BUTTON_SHORT : BUTTON_NOTHING;
  }
  if (held == TICKS_PER_SECOND) return BUTTON_NOTHING;
  return ++held == TICKS_PER_SECOND ? BUTTON_LONG : BUTTON_NOTHING;
}
