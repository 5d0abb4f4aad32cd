// SPDX-License-Identifier: Apache-2.0
#include "common/lens/lens_model.h"

#include "absl/strings/str_cat.h"

namespace rigcal {

const std::vector<LensModel>& AllLensModels() {
  static const auto* const kModels = new std::vector<LensModel>{
      LensModel::kPinhole4, LensModel::kPinhole5, LensModel::kFisheye, LensModel::kPinhole8};
  return *kModels;
}

std::string_view LensModelName(LensModel model) {
  switch (model) {
    case LensModel::kPinhole4:
      return "pinhole4";
    case LensModel::kPinhole5:
      return "pinhole5";
    case LensModel::kFisheye:
      return "fisheye";
    case LensModel::kPinhole8:
      return "pinhole8";
  }
  return "?";
}

absl::StatusOr<LensModel> ParseLensModel(std::string_view name) {
  for (const LensModel model : AllLensModels()) {
    if (name == LensModelName(model)) return model;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("there is no lens model \"", std::string(name),
                   "\", but pinhole4, pinhole5, pinhole8 and fisheye"));
}

DistortionModel DistortionModelOf(LensModel model) {
  switch (model) {
    case LensModel::kFisheye:
      return DistortionModel::kFisheye;
    case LensModel::kPinhole8:
      return DistortionModel::kRational;
    case LensModel::kPinhole4:
    case LensModel::kPinhole5:
      break;
  }
  return DistortionModel::kBrownConrady;
}

int FreeIntrinsics(LensModel model) {
  switch (model) {
    case LensModel::kPinhole4:
    case LensModel::kFisheye:
      return 8;
    case LensModel::kPinhole5:
      return 9;
    case LensModel::kPinhole8:
      return 12;
  }
  return 0;
}

}  // namespace rigcal
