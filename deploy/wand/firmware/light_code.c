// SPDX-License-Identifier: Apache-2.0
#include "light_code.h"

#include <avr/pgmspace.h>

enum { DEGREE = 20 };
#define FIRST_BITS 0x6B275UL

// The bits s[n + i] whose sum modulo 2 is s[n + 20], by code: bit i of its number. Each is a
// primitive polynomial without x^20, so that all states but zero follow one another.
#define TAPS(c, b, a) (1UL << (c) | 1UL << (b) | 1UL << (a) | 1UL)
static const uint32_t taps_of[LIGHT_CODE_MOST + 1] PROGMEM = {
    0,  // off: the state is zero, and stays it
    1UL << 3 | 1UL,
    TAPS(12, 8, 1),
    TAPS(13, 7, 2),
    TAPS(15, 9, 2),
    TAPS(17, 11, 2),
    TAPS(17, 6, 3),
    TAPS(16, 7, 3),
    TAPS(11, 9, 3),
};

static uint32_t taps;
static uint32_t state;  // s[n] to s[n + 19], the least significant first; n: the bit that is due

void light_code_start(uint8_t number) {
  taps = pgm_read_dword(&taps_of[number]);
  state = number == LIGHT_CODE_OFF ? 0 : FIRST_BITS;
}

bool light_code_bit(void) { return state & 1; }

void light_code_next(void) {
  const bool last = __builtin_parityl(state & taps);
  state >>= 1;
  if (last) state |= 1UL << (DEGREE - 1);  // shifting the bit there would take 19 rounds of a loop
}
