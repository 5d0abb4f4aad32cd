// SPDX-License-Identifier: Apache-2.0
// What a line says: a word, and numbers after it.
#pragma once

#include <avr/pgmspace.h>
#include <stdbool.h>
#include <stdint.h>

enum { COMMAND_NUMBERS = 3 };

struct command {
  const char* word;
  uint8_t count;  // numbers given
  uint16_t numbers[COMMAND_NUMBERS];
};

// False, after an error message to the serial line, if something behind the first word is no whole
// number up to 65535, or if there are more than three. Writes into `line`.
bool command_parse(char* line, struct command* command);

bool command_is(const struct command* command, PGM_P word);

void command_refuse(const struct command* command);  // says that there is no such word

// Each is true if the numbers are as they have to be, and false after an error message.
bool command_has_count(const struct command* command, uint8_t count);
bool command_in_range(const struct command* command, uint16_t least, uint16_t most);
