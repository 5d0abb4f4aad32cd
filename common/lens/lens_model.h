// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "common/camera/distortion_model.h"

namespace rigcal {

// What a lens can be solved as. The order is that of simplicity: of two that are as good the first
// one is taken.
enum class LensModel : uint8_t {
  kPinhole4 = 1,  // k1 k2 p1 p2; k3 = 0
  kPinhole5 = 2,  // k1 k2 p1 p2 k3
  kFisheye = 3,   // equidistant, k1 k2 k3 k4
  kPinhole8 = 4,  // k1 k2 p1 p2 k3 k4 k5 k6, rational
};

const std::vector<LensModel>& AllLensModels();  // the simplest first
// "pinhole4", "pinhole5", "fisheye", "pinhole8".
std::string_view LensModelName(LensModel model);
// INVALID_ARGUMENT: none of these words.
absl::StatusOr<LensModel> ParseLensModel(std::string_view name);

DistortionModel DistortionModelOf(LensModel model);
// How many values of an IntrinsicsVector of that distortion model are free, from the first one on:
// 8, 9, 8, 12.
int FreeIntrinsics(LensModel model);

}  // namespace rigcal
