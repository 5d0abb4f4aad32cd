// SPDX-License-Identifier: Apache-2.0
// Lines of text over the board's USB port: 38400 baud, 8 bits, no parity, 1 stop bit.
#pragma once

#include <avr/pgmspace.h>
#include <stdint.h>

enum { SERIAL_LINE_SIZE = 40 };  // of a line with its end; longer ones are refused

void serial_line_start(void);
// The next line, without its end and in lower case, once there is one; valid until the next call.
// Null: none yet, or an empty one, or one that was refused. What is typed is echoed.
char* serial_line_take(void);

// Text in flash: serial_say(PSTR("...")).
void serial_say(PGM_P text);
void serial_say_text(const char* text);
void serial_say_number(uint16_t number);
