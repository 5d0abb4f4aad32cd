// SPDX-License-Identifier: Apache-2.0
#include "stored_block.h"

#include <avr/eeprom.h>
#include <util/crc16.h>

enum { VERSION_AT = 0, CRC_AT = 1, BLOCK_AT = 3 };  // addresses

static uint8_t* at(int address) { return (uint8_t*)address; }

// CRC-16-CCITT of version and block, from 0xffff on.
static uint16_t crc_next(uint16_t crc, uint8_t byte) { return _crc_ccitt_update(crc, byte); }

bool stored_block_load(void* block, uint8_t size, uint8_t version) {
  uint16_t crc = crc_next(0xffff, version);
  for (uint8_t i = 0; i < size; ++i) crc = crc_next(crc, eeprom_read_byte(at(BLOCK_AT + i)));
  const uint16_t stored =
      (uint16_t)(eeprom_read_byte(at(CRC_AT)) | (uint16_t)eeprom_read_byte(at(CRC_AT + 1)) << 8);
  if (eeprom_read_byte(at(VERSION_AT)) != version || stored != crc) return false;
  eeprom_read_block(block, at(BLOCK_AT), size);
  return true;
}

void stored_block_save(const void* block, uint8_t size, uint8_t version) {
  const uint8_t* const bytes = block;
  uint16_t crc = crc_next(0xffff, version);
  for (uint8_t i = 0; i < size; ++i) {
    crc = crc_next(crc, bytes[i]);
    eeprom_update_byte(at(BLOCK_AT + i), bytes[i]);
  }
  eeprom_update_byte(at(VERSION_AT), version);
  eeprom_update_byte(at(CRC_AT), (uint8_t)crc);
  eeprom_update_byte(at(CRC_AT + 1), (uint8_t)(crc >> 8));
}
