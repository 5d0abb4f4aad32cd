// SPDX-License-Identifier: Apache-2.0
#include "pulse.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#include "compare_low.h"
#include "pins.h"

#define TICKS_PER_S (F_CPU / 64)
#define FIRST_SWITCH 100  // ticks from the start to the first pulse
#define TOGGLE (_BV(COM1A0) | _BV(COM1B0))

static volatile uint16_t high, low;  // ticks

// Called by the match that has switched both outputs.
ISR(TIMER1_COMPA_vect) {
  const uint16_t next = OCR1A + (PULSE_PIN & _BV(PULSE_BIT) ? high : low);
  OCR1A = next;
  OCR1B = next;
}

void pulse_stop(void) {
  TIMSK1 = 0;
  TCCR1A = 0;
  TCCR1B = 0;
  PULSE_PORT &= (uint8_t)~PULSE_BITS;
  PULSE_DDR |= PULSE_BITS;
}

void pulse_start(uint16_t hz, uint16_t width_us) {
  pulse_stop();
  const uint16_t period = (uint16_t)((TICKS_PER_S + hz / 2) / hz);
  high = (uint16_t)((width_us * (TICKS_PER_S / 1000) + 500) / 1000);
  low = period - high;
  compare_1_make_low();  // the units may remember a pulse
  TCNT1 = 0;
  OCR1A = OCR1B = FIRST_SWITCH;
  TCCR1A = TOGGLE;
  PULSE_DDR |= PULSE_BITS;
  TIFR1 = _BV(OCF1A);
  TIMSK1 = _BV(OCIE1A);
  TCCR1B = _BV(CS11) | _BV(CS10);
}
