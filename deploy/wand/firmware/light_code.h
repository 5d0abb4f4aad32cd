// SPDX-License-Identifier: Apache-2.0
// The bits that LED 2 sends by its brightness (docs/wand/firmware.md, Code): a maximum-length
// sequence of degree 20, which repeats after 2^20 - 1 bits. Each number has a sequence of its own.
#pragma once

#include <stdbool.h>
#include <stdint.h>

enum { LIGHT_CODE_OFF = 0, LIGHT_CODE_MOST = 8 };

// The first bit of the code `number`, up to the last number above. LIGHT_CODE_OFF: 0 for ever.
void light_code_start(uint8_t number);
bool light_code_bit(void);  // the bit that is due
void light_code_next(void);
