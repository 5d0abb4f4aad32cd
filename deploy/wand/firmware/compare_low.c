// SPDX-License-Identifier: Apache-2.0
#include "compare_low.h"

#include <avr/io.h>

#define MATCH_AT 20  // ticks of F_CPU from the start

void compare_1_make_low(void) {
  const uint8_t matches = _BV(OCF1A) | _BV(OCF1B);
  DDRB &= (uint8_t) ~(_BV(DDB1) | _BV(DDB2));
  TCCR1B = 0;
  TCCR1A = _BV(COM1A1) | _BV(COM1B1);
  TCNT1 = 0;
  OCR1A = OCR1B = MATCH_AT;
  TIFR1 = matches;
  TCCR1B = _BV(CS10);
  while ((TIFR1 & matches) != matches) {
  }
  TCCR1B = 0;
}

void compare_2b_make_low(void) {
  DDRD &= (uint8_t)~_BV(DDD3);
  TCCR2B = 0;
  TCCR2A = _BV(COM2B1);
  TCNT2 = 0;
  OCR2B = MATCH_AT;
  TIFR2 = _BV(OCF2B);
  TCCR2B = _BV(CS20);
  while (!(TIFR2 & _BV(OCF2B))) {
  }
  TCCR2B = 0;
}
