// SPDX-License-Identifier: Apache-2.0
// The firmware of the trigger generator (docs/wand/firmware.md).
#include <avr/interrupt.h>
#include <avr/sleep.h>
#include <stdbool.h>

#include "button.h"
#include "command.h"
#include "pulse.h"
#include "serial_line.h"
#include "status_led.h"
#include "ticks.h"
#include "trigger_settings.h"

static bool running = true;

ISR(TIMER0_OVF_vect) {
  static bool is_second;
  if (is_second) ticks_add();
  is_second = !is_second;
}

static void say_settings(void) {
  serial_say(PSTR("hz "));
  serial_say_number(trigger_settings.hz);
  serial_say(PSTR(", width "));
  serial_say_number(trigger_settings.width_us);
  serial_say(running ? PSTR(" us, running\r\n") : PSTR(" us, stopped\r\n"));
}

static void use_settings(void) {
  if (running) {
    pulse_start(trigger_settings.hz, trigger_settings.width_us);
  } else {
    pulse_stop();
  }
  status_led_set(running ? STATUS_GOOD : STATUS_OFF);
}

static bool is_possible(uint16_t hz, uint16_t width_us) {
  if ((uint32_t)width_us + PULSE_LEAST_REST_US <= 1000000 / hz) return true;
  serial_say(PSTR("error: a pulse of "));
  serial_say_number(width_us);
  serial_say(PSTR(" us does not fit into the period of "));
  serial_say_number(hz);
  serial_say(PSTR(" Hz; set the other one first\r\n"));
  return false;
}

static bool set_hz(const struct command* command) {
  if (!command_has_count(command, 1) || !command_in_range(command, PULSE_MIN_HZ, PULSE_MAX_HZ) ||
      !is_possible(command->numbers[0], trigger_settings.width_us)) {
    return false;
  }
  trigger_settings.hz = command->numbers[0];
  return true;
}

static bool set_width(const struct command* command) {
  if (!command_has_count(command, 1) || !command_in_range(command, PULSE_MIN_US, UINT16_MAX) ||
      !is_possible(trigger_settings.hz, command->numbers[0])) {
    return false;
  }
  trigger_settings.width_us = command->numbers[0];
  return true;
}

static bool run(const struct command* command, bool on) {
  if (!command_has_count(command, 0)) return false;
  running = on;
  return true;
}

static bool reset(const struct command* command) {
  if (!command_has_count(command, 0)) return false;
  trigger_settings_reset();
  return true;
}

// True if the settings are others now, or the pulses run or stop.
static bool execute(const struct command* command) {
  if (command_is(command, PSTR("hz"))) return set_hz(command);
  if (command_is(command, PSTR("width"))) return set_width(command);
  if (command_is(command, PSTR("start"))) return run(command, true);
  if (command_is(command, PSTR("stop"))) return run(command, false);
  if (command_is(command, PSTR("reset"))) return reset(command);
  if (command_is(command, PSTR("help"))) {
    serial_say(
        PSTR("show           settings\r\n"
             "hz 50          pulses a second, 5 to 200\r\n"
             "width 4000     length of a pulse, us, from 20 on\r\n"
             "start, stop    as the button does\r\n"
             "reset          all as it was when new\r\n"));
  } else if (command_is(command, PSTR("show"))) {
    say_settings();
  } else {
    command_refuse(command);
  }
  return false;
}

static void take_line(char* line) {
  struct command command;
  if (!command_parse(line, &command) || !execute(&command)) return;
  use_settings();
  trigger_settings_save();
  serial_say(PSTR("ok: "));
  say_settings();
}

int main(void) {
  button_start();
  status_led_start();
  serial_line_start();
  TCCR0B = _BV(CS02) | _BV(CS00);  // 1/1024 of the clock: overflows every 16.4 ms
  TIMSK0 = _BV(TOIE0);
  const bool stored = trigger_settings_load();
  sei();
  serial_say(PSTR("rigcal trigger; help lists the commands\r\n"));
  if (!stored) serial_say(PSTR("no settings are stored, or they are damaged: these are new\r\n"));
  say_settings();
  use_settings();

  for (uint16_t seen = ticks_now();;) {
    sleep_mode();  // idle, the mode after a reset: timers go on
    char* const line = serial_line_take();
    if (line != 0) take_line(line);
    if (ticks_now() == seen) continue;
    ++seen;
    if (button_look() == BUTTON_SHORT) {
      running = !running;
      use_settings();
      say_settings();
    }
    status_led_tick();
  }
}
