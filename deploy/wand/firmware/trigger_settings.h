// SPDX-License-Identifier: Apache-2.0
// What can be set of the trigger generator, and is kept while it is off.
#pragma once

#include <stdbool.h>
#include <stdint.h>

struct trigger_settings {
  uint16_t hz;
  uint16_t width_us;  // of a pulse
};

extern struct trigger_settings trigger_settings;  // those that are in use

void trigger_settings_reset(void);  // to the defaults; not stored
bool trigger_settings_load(void);   // false, with the defaults: nothing stored, or damaged
void trigger_settings_save(void);
