// SPDX-License-Identifier: Apache-2.0
#include "serial_line.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <stdbool.h>
#include <stdlib.h>

#define BAUD 38400
#include <util/setbaud.h>

enum { RING = 64 };  // bytes that wait; a power of two
static volatile uint8_t ring[RING];
static volatile uint8_t ring_head, ring_tail;
static volatile bool ring_overrun;

ISR(USART_RX_vect) {
  const uint8_t byte = UDR0;
  const uint8_t next = (uint8_t)((ring_head + 1) % RING);
  if (next == ring_tail) {
    ring_overrun = true;
    return;
  }
  ring[ring_head] = byte;
  ring_head = next;
}

void serial_line_start(void) {
  UBRR0 = UBRR_VALUE;
#if USE_2X
  UCSR0A = _BV(U2X0);
#endif
  UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
  UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
}

static void send(char byte) {
  while (!(UCSR0A & _BV(UDRE0))) {
  }
  UDR0 = (uint8_t)byte;
}

void serial_say(PGM_P text) {
  for (char c; (c = (char)pgm_read_byte(text)) != 0; ++text) send(c);
}

void serial_say_text(const char* text) {
  while (*text != 0) send(*text++);
}

void serial_say_number(uint16_t number) {
  char digits[6];
  serial_say_text(utoa(number, digits, 10));
}

char* serial_line_take(void) {
  static char line[SERIAL_LINE_SIZE];
  static uint8_t length;
  static bool refused;  // the rest of this line, too
  while (ring_tail != ring_head) {
    char c = (char)ring[ring_tail];
    ring_tail = (uint8_t)((ring_tail + 1) % RING);
    if (c == '\r' || c == '\n') {
      const bool good = length > 0 && !refused && !ring_overrun;
      if (length > 0 || refused) serial_say(PSTR("\r\n"));
      if (refused || ring_overrun) {
        serial_say(PSTR("error: the line is too long or holds what is no text; try help\r\n"));
      }
      line[length] = 0;
      length = 0;
      refused = ring_overrun = false;
      if (good) return line;
    } else if (c == '\b' || c == 0x7f) {
      if (length == 0) continue;
      --length;
      serial_say(PSTR("\b \b"));
    } else if (c < ' ' || c > '~' || length + 1 == SERIAL_LINE_SIZE) {
      refused = true;
    } else {
      send(c);
      if (c >= 'A' && c <= 'Z') c = (char)(c - 'A' + 'a');
      line[length++] = c;
    }
  }
  return 0;
}
