// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "server/live/alert_book.h"
#include "server/live/followed_rig.h"
#include "server/store/store.h"

namespace rigcal::server {

// All that should be said of the rig and, while it captures, of each camera now. Gathers the facts;
// alert_rules.h decides. `now` and `utc_ns` are one instant on the server's two clocks.
std::vector<AlertCondition> ConditionsOf(const FollowedRig& rig, const StoreHealth& health,
                                         FollowedRig::Time now, int64_t utc_ns);

}  // namespace rigcal::server
