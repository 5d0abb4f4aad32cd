// SPDX-License-Identifier: Apache-2.0
// What can be set of the wand, and is kept while it is off.
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "blink.h"

struct wand_settings {
  uint16_t hz[BLINK_LEDS];  // blink frequencies
  uint8_t duty_pct;         // share of a period in which an LED is lit
  uint8_t brightness_pct;
  uint8_t code;     // number of the light code (light_code.h), which needs a duty of 40 to 80 %
  uint16_t low_mv;  // the battery is low below this; 0: its voltage is not looked at
};

enum { LOW_MV_MIN = 2500, LOW_MV_MAX = 9000 };

extern struct wand_settings wand_settings;  // those that are in use

void wand_settings_reset(void);  // to the defaults; not stored
bool wand_settings_load(void);   // false, with the defaults: nothing stored, or damaged
void wand_settings_save(void);

// The button's choices: frequencies that follow each other, and three steps of brightness. Each
// returns the number of the choice, from 1 on.
uint8_t wand_settings_next_hz(void);
uint8_t wand_settings_next_brightness(void);
