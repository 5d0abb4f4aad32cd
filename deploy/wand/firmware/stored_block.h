// SPDX-License-Identifier: Apache-2.0
// A block of settings in the EEPROM, with a checksum.
#pragma once

#include <stdbool.h>
#include <stdint.h>

// Both take a block of `size` bytes of layout `version`, the only one in the EEPROM. Loading fails,
// and leaves the block as it was, if nothing was stored, if it has another version or is damaged.
bool stored_block_load(void* block, uint8_t size, uint8_t version);
// Writes only bytes that differ: each of them lasts 100 000 changes.
void stored_block_save(const void* block, uint8_t size, uint8_t version);
