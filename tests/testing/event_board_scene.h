// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "common/simulation/events/event_board_scene.h"

namespace rigcal::testing {

using rigcal::BoardPath;
using rigcal::EventBoardLight;
using rigcal::EventBoardScene;
using rigcal::HandHeld;
using rigcal::Waved;

}  // namespace rigcal::testing
