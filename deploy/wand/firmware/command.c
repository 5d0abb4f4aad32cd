// SPDX-License-Identifier: Apache-2.0
#include "command.h"

#include <string.h>

#include "serial_line.h"

static bool number_parse(const char* word, uint16_t* number) {
  uint32_t value = 0;
  for (; *word != 0; ++word) {
    if (*word < '0' || *word > '9') return false;
    value = 10 * value + (uint8_t)(*word - '0');
    if (value > UINT16_MAX) return false;
  }
  *number = (uint16_t)value;
  return true;
}

bool command_parse(char* line, struct command* command) {
  char* rest = line;
  command->word = strsep(&rest, " ");
  command->count = 0;
  for (const char* word; (word = strsep(&rest, " ")) != 0;) {
    if (*word == 0) continue;  // several blanks
    if (command->count == COMMAND_NUMBERS) {
      serial_say(PSTR("error: too many numbers; try help\r\n"));
      return false;
    }
    if (!number_parse(word, &command->numbers[command->count++])) {
      serial_say(PSTR("error: "));
      serial_say_text(word);
      serial_say(PSTR(" is no whole number from 0 to 65535\r\n"));
      return false;
    }
  }
  return true;
}

bool command_is(const struct command* command, PGM_P word) {
  return strcmp_P(command->word, word) == 0;
}

void command_refuse(const struct command* command) {
  serial_say(PSTR("error: no command "));
  serial_say_text(command->word);
  serial_say(PSTR("; try help\r\n"));
}

bool command_has_count(const struct command* command, uint8_t count) {
  if (command->count == count) return true;
  serial_say(PSTR("error: "));
  serial_say_text(command->word);
  serial_say(PSTR(" takes "));
  serial_say_number(count);
  serial_say(PSTR(" number(s), not "));
  serial_say_number(command->count);
  serial_say(PSTR("; try help\r\n"));
  return false;
}

bool command_in_range(const struct command* command, uint16_t least, uint16_t most) {
  for (uint8_t i = 0; i < command->count; ++i) {
    const uint16_t number = command->numbers[i];
    if (number >= least && number <= most) continue;
    serial_say(PSTR("error: "));
    serial_say_text(command->word);
    serial_say(PSTR(" can be "));
    serial_say_number(least);
    serial_say(PSTR(" to "));
    serial_say_number(most);
    serial_say(PSTR(", not "));
    serial_say_number(number);
    serial_say(PSTR("\r\n"));
    return false;
  }
  return true;
}
