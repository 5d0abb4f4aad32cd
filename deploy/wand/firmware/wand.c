// SPDX-License-Identifier: Apache-2.0
// The firmware of the wand (docs/wand/firmware.md).
#include <avr/interrupt.h>
#include <avr/sleep.h>
#include <stdbool.h>

#include "battery.h"
#include "blink.h"
#include "button.h"
#include "dimmer.h"
#include "serial_line.h"
#include "status_led.h"
#include "ticks.h"
#include "wand_commands.h"
#include "wand_settings.h"

// Timer 1 runs whether the LEDs blink or not, and overflows every 65536 of its ticks.
ISR(TIMER1_OVF_vect) { ticks_add(); }

static void use_settings(void) {
  dimmer_set(wand_settings.brightness_pct);
  if (battery_state() == BATTERY_EMPTY) {
    blink_stop();
  } else {
    blink_start(wand_settings.hz, wand_settings.duty_pct, wand_settings.code);
  }
}

static void look_at_button(void) {
  switch (button_look()) {
    case BUTTON_SHORT:
      status_led_count(wand_settings_next_hz());
      break;
    case BUTTON_LONG:
      status_led_count(wand_settings_next_brightness());
      break;
    case BUTTON_NOTHING:
      return;
  }
  use_settings();
  wand_settings_save();
  wand_say_settings();
}

static void look_at_battery(void) {
  const enum battery_state before = battery_state();
  battery_look(wand_settings.low_mv);
  const enum battery_state now = battery_state();
  status_led_set(now == BATTERY_GOOD  ? STATUS_GOOD
                 : now == BATTERY_LOW ? STATUS_LOW
                                      : STATUS_EMPTY);
  if (now == before) return;
  wand_say_battery();
  if (before == BATTERY_EMPTY || now == BATTERY_EMPTY) use_settings();
}

int main(void) {
  button_start();
  status_led_start();
  serial_line_start();
  const bool stored = wand_settings_load();
  sei();
  serial_say(PSTR("rigcal wand; help lists the commands\r\n"));
  if (!stored) serial_say(PSTR("no settings are stored, or they are damaged: these are new\r\n"));
  wand_say_settings();
  use_settings();
  look_at_battery();

  uint16_t seen = ticks_now();
  for (uint8_t to_battery = TICKS_PER_SECOND;;) {
    sleep_mode();  // idle, the mode after a reset: timers go on
    char* const line = serial_line_take();
    if (line != 0 && wand_command(line)) {
      use_settings();
      wand_settings_save();
    }
    if (ticks_now() == seen) continue;
    ++seen;
    look_at_button();
    status_led_tick();
    if (--to_battery == 0) {
      to_battery = TICKS_PER_SECOND;
      look_at_battery();
    }
  }
}
