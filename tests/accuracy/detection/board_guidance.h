// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tests/accuracy/seed_options.h"

namespace rigcal::accuracy {

// How many views of a board a lens needs with the advice where to hold it next, and with the board
// waved at random.
void PrintBoardGuidance(const SeedOptions& seeds);

}  // namespace rigcal::accuracy
