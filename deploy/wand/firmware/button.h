// SPDX-License-Identifier: Apache-2.0
// The push button between D2 and ground.
#pragma once

#include <stdint.h>

enum button_event { BUTTON_NOTHING, BUTTON_SHORT, BUTTON_LONG };

void button_start(void);
// Called once a tick (33 ms, longer than contacts bounce). A short press counts when it ends, a
// long one when it has lasted a second.
enum button_event button_look(void);
