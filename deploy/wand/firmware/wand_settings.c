// SPDX-License-Identifier: Apache-2.0
#include "wand_settings.h"

#include <string.h>

#include "light_code.h"
#include "stored_block.h"

enum { LAYOUT = 2, HZ_CHOICES = 3, BRIGHTNESS_CHOICES = 3 };

// One frequency for all; three, by which event cameras tell the spheres apart; slow, for event
// cameras with a long refractory period.
static const uint16_t hz_choices[HZ_CHOICES][BLINK_LEDS] = {
    {500, 500, 500}, {400, 500, 620}, {200, 200, 200}};
static const uint8_t brightness_choices[BRIGHTNESS_CHOICES] = {100, 50, 25};

struct wand_settings wand_settings;

void wand_settings_reset(void) {
  memcpy(wand_settings.hz, hz_choices[0], sizeof(wand_settings.hz));
  wand_settings.duty_pct = 50;
  wand_settings.brightness_pct = brightness_choices[0];
  wand_settings.code = LIGHT_CODE_OFF;
  wand_settings.low_mv = 3500;
}

bool wand_settings_load(void) {
  if (stored_block_load(&wand_settings, sizeof(wand_settings), LAYOUT)) return true;
  wand_settings_reset();
  return false;
}

void wand_settings_save(void) { stored_block_save(&wand_settings, sizeof(wand_settings), LAYOUT); }

uint8_t wand_settings_next_hz(void) {
  uint8_t choice = 0;  // after frequencies that are none of the choices
  for (uint8_t i = 0; i < HZ_CHOICES; ++i) {
    if (memcmp(wand_settings.hz, hz_choices[i], sizeof(wand_settings.hz)) == 0) {
      choice = (uint8_t)((i + 1) % HZ_CHOICES);
    }
  }
  memcpy(wand_settings.hz, hz_choices[choice], sizeof(wand_settings.hz));
  return (uint8_t)(choice + 1);
}

uint8_t wand_settings_next_brightness(void) {
  uint8_t choice = 0;
  for (uint8_t i = 0; i < BRIGHTNESS_CHOICES; ++i) {
    if (wand_settings.brightness_pct == brightness_choices[i]) {
      choice = (uint8_t)((i + 1) % BRIGHTNESS_CHOICES);
    }
  }
  wand_settings.brightness_pct = brightness_choices[choice];
  return (uint8_t)(choice + 1);
}
