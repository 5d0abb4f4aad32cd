// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/session/observation_batch.h"
#include "common/simulation/world/simulated_world.h"
#include "rigcal/v1/session.pb.h"

namespace rigcal::testing {

// Fails the test unless `batches`, as ServerClient::ReadObservations gives them, hold what the
// cameras of `world` have detected: every observation of each from the first on, once, in order and
// with its values, up to the last that its agent has reported in `session`. Each camera has one
// stream, which has ended.
void ExpectSimulatedRows(const SimulatedWorld& world, const std::vector<ObservationBatch>& batches,
                         const v1::Session& session);

}  // namespace rigcal::testing
