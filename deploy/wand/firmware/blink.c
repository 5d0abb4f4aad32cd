// SPDX-License-Identifier: Apache-2.0
#include "blink.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#include "pins.h"

#define TICKS_PER_S (F_CPU / 8)
#define FIRST_SWITCH 200  // ticks from the start to the first light

// What a compare unit does with its pin on a match.
#define TOGGLE_1_AND_2 (_BV(COM1A0) | _BV(COM1B0))
#define CLEAR_1_AND_2 (_BV(COM1A1) | _BV(COM1B1))
#define TOGGLE_3 _BV(COM2B0)
#define CLEAR_3 _BV(COM2B1)

struct blink_period {
  uint16_t lit, dark;  // ticks
};
static volatile struct blink_period periods[BLINK_LEDS];
static volatile uint16_t ticks_left_3;  // from the next match of LED 3's clock to its next switch

// Called by the match that has switched the LED.
ISR(TIMER1_COMPA_vect) { OCR1A += LED_1_PIN & _BV(LED_1_BIT) ? periods[0].lit : periods[0].dark; }
ISR(TIMER1_COMPB_vect) { OCR1B += LED_2_PIN & _BV(LED_2_BIT) ? periods[1].lit : periods[1].dark; }

// Timer 2 counts to 256 only. Its unit A, which has no pin, measures the time in steps; unit B,
// which has the LED's, stays behind the counter, where nothing matches, and joins unit A for the
// last step. Every step is short enough for unit B to be moved on before the counter has come round
// to it, and long enough (100 ticks) for this interrupt.
ISR(TIMER2_COMPA_vect) {
  uint16_t left = ticks_left_3;
  if (left == 0) left = LED_3_PIN & _BV(LED_3_BIT) ? periods[2].lit : periods[2].dark;
  const uint8_t now = OCR2A;
  const uint8_t step = (uint8_t)(left > 400 ? 200 : left > 200 ? left / 2 : left);
  left -= step;
  OCR2A = (uint8_t)(now + step);
  OCR2B = (uint8_t)(left == 0 ? now + step : now - 1);
  ticks_left_3 = left;
}

void blink_stop(void) {
  TCCR1B = _BV(CS11);  // the program's ticks go on
  TIMSK1 = _BV(TOIE1);
  TCCR2B = 0;
  TIMSK2 = 0;
  TCCR1A = 0;  // the pins are the ports' again
  TCCR2A = 0;
  LED_1_PORT &= (uint8_t)~_BV(LED_1_BIT);
  LED_2_PORT &= (uint8_t)~_BV(LED_2_BIT);
  LED_3_PORT &= (uint8_t)~_BV(LED_3_BIT);
  LED_1_DDR |= _BV(LED_1_BIT);
  LED_2_DDR |= _BV(LED_2_BIT);
  LED_3_DDR |= _BV(LED_3_BIT);
}

void blink_start(const uint16_t hz[BLINK_LEDS], uint8_t duty_pct) {
  blink_stop();
  for (uint8_t i = 0; i < BLINK_LEDS; ++i) {
    const uint16_t period = (uint16_t)((TICKS_PER_S + hz[i] / 2) / hz[i]);
    periods[i].lit = (uint16_t)(((uint32_t)period * duty_pct + 50) / 100);
    periods[i].dark = period - periods[i].lit;
  }
  TCCR1B = 0;
  // A unit remembers whether its LED was lit: make it forget.
  TCCR1A = CLEAR_1_AND_2;
  TCCR1C = _BV(FOC1A) | _BV(FOC1B);
  TCCR2A = CLEAR_3;
  TCCR2B = _BV(FOC2B);
  TCCR1A = TOGGLE_1_AND_2;
  TCCR2A = TOGGLE_3;

  TCNT1 = 0;
  TCNT2 = 0;
  OCR1A = OCR1B = FIRST_SWITCH;
  OCR2A = OCR2B = FIRST_SWITCH;
  ticks_left_3 = 0;
  TIFR1 = _BV(OCF1A) | _BV(OCF1B);
  TIFR2 = _BV(OCF2A);
  TIMSK1 = _BV(OCIE1A) | _BV(OCIE1B) | _BV(TOIE1);
  TIMSK2 = _BV(OCIE2A);
  GTCCR = _BV(TSM) | _BV(PSRASY) | _BV(PSRSYNC);  // both timers start at one moment:
  TCCR1B = _BV(CS11);
  TCCR2B = _BV(CS21);
  GTCCR = 0;  // now
}
