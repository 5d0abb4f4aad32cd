// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "common/calibration/activation.h"
#include "rigcal/v1/rig_service.pb.h"

namespace rigcal::wire {

v1::Activation ToProto(const Activation& activation);
Activation FromProto(const v1::Activation& proto);

// The store's form; bytes of equal activations are equal.
std::string SerializeActivation(const Activation& activation);
// DATA_LOSS: the bytes are damaged.
absl::StatusOr<Activation> ParseActivation(std::string_view bytes);

}  // namespace rigcal::wire
