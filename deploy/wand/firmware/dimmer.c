// SPDX-License-Identifier: Apache-2.0
#include "dimmer.h"

#include "pins.h"

void dimmer_set(uint8_t percent) {
  DIM_PORT |= _BV(DIM_BIT);
  DIM_DDR |= _BV(DIM_BIT);
  if (percent >= DIMMER_MAX) {
    TCCR0A = 0;
    TCCR0B = 0;
    DIM_PORT |= _BV(DIM_BIT);
    return;
  }
  OCR0A = (uint8_t)(percent * 256u / 100 - 1);
  TCCR0A = _BV(COM0A1) | _BV(WGM01) | _BV(WGM00);  // fast PWM
  TCCR0B = _BV(CS00);
}
