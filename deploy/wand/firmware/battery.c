// SPDX-License-Identifier: Apache-2.0
#include "battery.h"

#include "pins.h"

enum { SAMPLES = 16 };  // their mean hardly sees the LEDs blink
enum { EMPTY_BELOW_LOW = 200, LOW_HYSTERESIS = 100, EMPTY_HYSTERESIS = 400 };  // mV

static enum battery_state state;
static uint16_t mv;

static uint16_t measure_mv(void) {
  ADMUX = _BV(REFS0) | BATTERY_ADC;                           // against AVCC
  ADCSRA = _BV(ADEN) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0);  // clock of 125 kHz
  uint16_t sum = 0;
  for (uint8_t i = 0; i < SAMPLES; ++i) {
    ADCSRA |= _BV(ADSC);
    while (ADCSRA & _BV(ADSC)) {
    }
    sum += ADC;
  }
  return (uint16_t)((uint32_t)sum * 10000 / (1024UL * SAMPLES));
}

static enum battery_state state_next(uint16_t low_mv) {
  if (low_mv == 0) return BATTERY_GOOD;
  const uint16_t empty_mv = low_mv - EMPTY_BELOW_LOW;
  if (mv < empty_mv) return BATTERY_EMPTY;
  if (state == BATTERY_EMPTY && mv < empty_mv + EMPTY_HYSTERESIS) return BATTERY_EMPTY;
  if (mv < low_mv) return BATTERY_LOW;
  if (state != BATTERY_GOOD && mv < low_mv + LOW_HYSTERESIS) return BATTERY_LOW;
  return BATTERY_GOOD;
}

void battery_look(uint16_t low_mv) {
  mv = measure_mv();
  state = state_next(low_mv);
}

enum battery_state battery_state(void) { return state; }
uint16_t battery_mv(void) { return mv; }
