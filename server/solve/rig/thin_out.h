// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "server/associate/instants.h"
#include "server/solve/rig/problem_builder.h"

namespace rigcal::server {

// Leaves instants with about `max_observations` members in all; 0: leaves all. An instant stays or
// goes by its first member alone, so that nearly the same ones stay when clocks move; which, looks
// random, so that cameras of different rates are thinned alike. Of a camera with less than its
// share of the observations all instants stay.
void ThinOut(const RigIndex& index, size_t max_observations, std::vector<Instant>* instants);

}  // namespace rigcal::server
