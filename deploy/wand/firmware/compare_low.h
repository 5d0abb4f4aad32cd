// SPDX-License-Identifier: Apache-2.0
// A compare unit that switches a pin remembers the level that it gave last, and gives it again when
// it gets the pin back.
#pragma once

// Each makes units remember a low level, by a match that clears them: with a stopped timer, nothing
// says that a forced compare does. The timer is stopped afterwards, the units still clear, and
// their pins are inputs: nothing of it is seen. Takes some microseconds.
void compare_1_make_low(void);   // OC1A and OC1B
void compare_2b_make_low(void);  // OC2B
