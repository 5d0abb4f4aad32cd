// SPDX-License-Identifier: Apache-2.0
#include "wand_commands.h"

#include "battery.h"
#include "command.h"
#include "dimmer.h"
#include "light_code.h"
#include "serial_line.h"
#include "wand_settings.h"

static void say_help(void) {
  serial_say(
      PSTR("show               settings and battery\r\n"
           "hz 500             blink frequency of all LEDs, 100 to 1000 Hz\r\n"
           "hz 400 500 620     one of each LED\r\n"
           "duty 50            share of a period in which an LED is lit, 5 to 95 %\r\n"
           "brightness 100     10 to 100 %\r\n"
           "code 1             light code of a wand, 1 to 8; 0: none\r\n"
           "low 3500           low battery, 2500 to 9000 mV; 0: no battery to watch\r\n"
           "reset              all as it was when new\r\n"));
}

void wand_say_settings(void) {
  serial_say(PSTR("hz"));
  for (uint8_t i = 0; i < BLINK_LEDS; ++i) {
    serial_say(PSTR(" "));
    serial_say_number(wand_settings.hz[i]);
  }
  serial_say(PSTR(", duty "));
  serial_say_number(wand_settings.duty_pct);
  serial_say(PSTR(" %, brightness "));
  serial_say_number(wand_settings.brightness_pct);
  serial_say(PSTR(" %, low "));
  serial_say_number(wand_settings.low_mv);
  serial_say(PSTR(" mV, code "));
  serial_say_number(wand_settings.code);
  serial_say(PSTR("\r\n"));
}

void wand_say_battery(void) {
  serial_say(PSTR("battery "));
  serial_say_number(battery_mv());
  serial_say(PSTR(" mV"));
  if (battery_state() == BATTERY_LOW) serial_say(PSTR(": low, charge it"));
  if (battery_state() == BATTERY_EMPTY)
    serial_say(PSTR(": empty, the spheres are dark; charge it"));
  serial_say(PSTR("\r\n"));
}

// Sets all frequencies, if the command says which.
static bool set_hz(const struct command* command) {
  if (command->count != 1 && command->count != BLINK_LEDS) {
    serial_say(PSTR("error: hz takes one number, or three; try help\r\n"));
    return false;
  }
  if (!command_in_range(command, BLINK_MIN_HZ, BLINK_MAX_HZ)) return false;
  for (uint8_t i = 0; i < BLINK_LEDS; ++i) {
    wand_settings.hz[i] = command->numbers[command->count == 1 ? 0 : i];
  }
  return true;
}

static bool set_low(const struct command* command) {
  if (!command_has_count(command, 1)) return false;
  const uint16_t mv = command->numbers[0];
  if (mv != 0 && !command_in_range(command, LOW_MV_MIN, LOW_MV_MAX)) return false;
  wand_settings.low_mv = mv;
  return true;
}

static bool set_number(const struct command* command, uint8_t least, uint8_t most,
                       uint8_t* number) {
  if (!command_has_count(command, 1) || !command_in_range(command, least, most)) return false;
  *number = (uint8_t)command->numbers[0];
  return true;
}

// Duty and code, which have to fit each other: changes both or neither.
static bool set_light(uint8_t duty_pct, uint8_t code) {
  if (code != LIGHT_CODE_OFF &&
      (duty_pct < BLINK_CODE_MIN_DUTY || duty_pct > BLINK_CODE_MAX_DUTY)) {
    serial_say(PSTR("error: code needs a duty of 40 to 80 %, not "));
    serial_say_number(duty_pct);
    serial_say(code == wand_settings.code ? PSTR("; type code 0 first\r\n")
                                          : PSTR("; type duty 50 first\r\n"));
    return false;
  }
  wand_settings.duty_pct = duty_pct;
  wand_settings.code = code;
  return true;
}

static bool set_duty(const struct command* command) {
  uint8_t duty_pct;
  return set_number(command, BLINK_MIN_DUTY, BLINK_MAX_DUTY, &duty_pct) &&
         set_light(duty_pct, wand_settings.code);
}

static bool set_code(const struct command* command) {
  uint8_t code;
  return set_number(command, LIGHT_CODE_OFF, LIGHT_CODE_MOST, &code) &&
         set_light(wand_settings.duty_pct, code);
}

static bool reset(const struct command* command) {
  if (!command_has_count(command, 0)) return false;
  wand_settings_reset();
  return true;
}

// True if the settings are others now.
static bool execute(const struct command* command) {
  if (command_is(command, PSTR("hz"))) return set_hz(command);
  if (command_is(command, PSTR("duty"))) return set_duty(command);
  if (command_is(command, PSTR("code"))) return set_code(command);
  if (command_is(command, PSTR("brightness"))) {
    return set_number(command, DIMMER_MIN, DIMMER_MAX, &wand_settings.brightness_pct);
  }
  if (command_is(command, PSTR("low"))) return set_low(command);
  if (command_is(command, PSTR("reset"))) return reset(command);
  if (command_is(command, PSTR("help"))) {
    say_help();
  } else if (command_is(command, PSTR("show"))) {
    wand_say_settings();
    wand_say_battery();
  } else {
    command_refuse(command);
  }
  return false;
}

bool wand_command(char* line) {
  struct command command;
  if (!command_parse(line, &command) || !execute(&command)) return false;
  serial_say(PSTR("ok: "));
  wand_say_settings();
  return true;
}
