// SPDX-License-Identifier: Apache-2.0
// The wand's serial commands.
#pragma once

#include <stdbool.h>

// Executes one line, which it writes into, and answers on the serial line. True: the settings are
// others now.
bool wand_command(char* line);

void wand_say_settings(void);
void wand_say_battery(void);
