// SPDX-License-Identifier: Apache-2.0
#include "trigger_settings.h"

#include "stored_block.h"

enum { LAYOUT = 101 };  // others than the wand's: a board may have been a wand before

struct trigger_settings trigger_settings;

void trigger_settings_reset(void) {
  trigger_settings.hz = 50;
  trigger_settings.width_us = 4000;  // two blinks of the wand
}

bool trigger_settings_load(void) {
  if (stored_block_load(&trigger_settings, sizeof(trigger_settings), LAYOUT)) return true;
  trigger_settings_reset();
  return false;
}

void trigger_settings_save(void) {
  stored_block_save(&trigger_settings, sizeof(trigger_settings), LAYOUT);
}
