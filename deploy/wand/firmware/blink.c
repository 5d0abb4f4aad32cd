// SPDX-License-Identifier: Apache-2.0
#include "blink.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#include "compare_low.h"
#include "light_code.h"
#include "pins.h"

#define TICKS_PER_S (F_CPU / 8)
#define TICKS_PER_BIT (TICKS_PER_S / 10)
#define FIRST_SWITCH 200  // ticks from the start to the first light
#define MOST_STEP 170     // ticks from one interrupt of timer 2 to the next

// A compare unit switches its pin on every match.
#define TOGGLE_1_AND_2 (_BV(COM1A0) | _BV(COM1B0))
#define TOGGLE_3 _BV(COM2B0)

struct blink_period {
  uint16_t lit, dark;  // ticks
};
static volatile struct blink_period periods[BLINK_LEDS];
static volatile uint16_t ticks_left_3;  // from the next match of LED 3's clock to its next switch

// LED 2's rises as they are without a code: none of them moves by what the code does to its light.
static uint16_t cut_of_one;  // ticks that a bit 1 cuts off each end of the light
static uint16_t cut;         // that of the period that goes on
static uint32_t into_bit;    // ticks from the bit's begin to the period's

// Goes on to LED 2's next period.
static void next_period_2(void) {
  into_bit += periods[1].lit + periods[1].dark;
  if (into_bit >= TICKS_PER_BIT) {  // no period is longer than a bit
    into_bit -= TICKS_PER_BIT;
    light_code_next();
  }
  cut = light_code_bit() ? cut_of_one : 0;
}

// Called by the match that has switched the LED.
ISR(TIMER1_COMPA_vect) { OCR1A += LED_1_PIN & _BV(LED_1_BIT) ? periods[0].lit : periods[0].dark; }
ISR(TIMER1_COMPB_vect) {
  if (LED_2_PIN & _BV(LED_2_BIT)) {
    OCR1B += periods[1].lit - 2 * cut;
  } else {
    const uint16_t fall = OCR1B + cut;
    next_period_2();
    OCR1B = fall + periods[1].dark + cut;
  }
}

// Timer 2 counts to 256 only. Its unit A, which has no pin, measures the time in steps; unit B,
// which has the LED's, stays behind the counter, where nothing matches, and joins unit A for the
// last step. This interrupt has to move both on within 85 ticks (680 cycles) of unit A's match,
// also if it waits for the end of another one: no step is shorter, and after the longest the
// counter takes as many to come round to unit B.
ISR(TIMER2_COMPA_vect) {
  uint16_t left = ticks_left_3;
  if (left == 0) left = LED_3_PIN & _BV(LED_3_BIT) ? periods[2].lit : periods[2].dark;
  const uint8_t now = OCR2A;
  const uint8_t step = (uint8_t)(left > 2 * MOST_STEP ? MOST_STEP
                                 : left > MOST_STEP   ? left / 2
                                                      : left);
  left -= step;
  OCR2A = (uint8_t)(now + step);
  OCR2B = (uint8_t)(left == 0 ? now + step : now - 1);
  ticks_left_3 = left;
}

static void pins_to_outputs(void) {
  LED_1_DDR |= _BV(LED_1_BIT);
  LED_2_DDR |= _BV(LED_2_BIT);
  LED_3_DDR |= _BV(LED_3_BIT);
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
  pins_to_outputs();
}

void blink_start(const uint16_t hz[BLINK_LEDS], uint8_t duty_pct, uint8_t code) {
  blink_stop();
  for (uint8_t i = 0; i < BLINK_LEDS; ++i) {
    const uint16_t period = (uint16_t)((TICKS_PER_S + hz[i] / 2) / hz[i]);
    periods[i].lit = (uint16_t)(((uint32_t)period * duty_pct + 50) / 100);
    periods[i].dark = period - periods[i].lit;
  }
  cut_of_one = (periods[1].lit + periods[1].dark + 5) / 10;
  into_bit = 0;
  light_code_start(code);
  cut = light_code_bit() ? cut_of_one : 0;

  compare_1_make_low();
  compare_2b_make_low();
  TCNT1 = 0;
  TCNT2 = 0;
  OCR1A = FIRST_SWITCH;
  OCR1B = FIRST_SWITCH + cut;
  OCR2A = OCR2B = FIRST_SWITCH;
  ticks_left_3 = 0;
  TCCR1A = TOGGLE_1_AND_2;
  TCCR2A = TOGGLE_3;
  pins_to_outputs();
  TIFR1 = _BV(OCF1A) | _BV(OCF1B);
  TIFR2 = _BV(OCF2A);
  TIMSK1 = _BV(OCIE1A) | _BV(OCIE1B) | _BV(TOIE1);
  TIMSK2 = _BV(OCIE2A);
  GTCCR = _BV(TSM) | _BV(PSRASY) | _BV(PSRSYNC);  // both timers start at one moment:
  TCCR1B = _BV(CS11);
  TCCR2B = _BV(CS21);
  GTCCR = 0;  // now
}
