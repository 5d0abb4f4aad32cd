// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "tests/accuracy/seed_options.h"

namespace rigcal::accuracy {

// Lenses of an event camera from boards of circles, a line for each case with `only` in its name.
void PrintEventBoards(const SeedOptions& seeds, const std::string& only);

}  // namespace rigcal::accuracy
