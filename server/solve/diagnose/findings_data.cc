// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "server/solve/diagnose/finding_causes.h"

namespace rigcal::server {

std::vector<Cause> FindTooLittleData(const CauseInput& input) {
  const PredictedError& predicted = input.evaluated.predicted;
  if (!predicted.holds && predicted.block_count >= kMinPredictedBlocks &&
      predicted.scarcest_block_count < kMinCameraBlocks) {
    return {{{FindingKind::kTooLittleData, predicted.scarcest_camera,
              static_cast<double>(predicted.scarcest_block_count), "blocks of 2 s",
              absl::StrFormat("it sees the wand in %d blocks of 2 s only, which cannot show how "
                              "accurately its position is known. Wave where it sees the wand, and "
                              "come back there several times",
                              predicted.scarcest_block_count)},
             0}};
  }
  if (!predicted.holds) {
    return {
        {{FindingKind::kTooLittleData, "", static_cast<double>(predicted.instant_count), "instants",
          absl::StrFormat(
              "%d instants in %d blocks of 2 s cannot show how accurate the calibration is: its "
              "stated uncertainty does not hold. Wave for a minute, through the whole volume",
              predicted.instant_count, predicted.block_count)},
         0}};
  }
  if (predicted.sigma_m <= predicted.accepted_m) return {};
  const double unit = input.result.scale_known ? 1e3 : 1;
  const char* const name = input.result.scale_known ? "mm" : "units of length";
  return {{{FindingKind::kTooLittleData, "", unit * predicted.sigma_m, name,
            absl::StrFormat(
                "the camera positions are known to %.3g %s (one sigma: %.3g by the covariance%s), "
                "%.3g %s are accepted. Wave longer, through the whole volume, near and far%s",
                unit * predicted.sigma_m, name, unit * predicted.stated_m,
                absl::StrCat(predicted.by_lenses_m > 0
                                 ? absl::StrFormat(", %.3g by lenses that were kept as given",
                                                   unit * predicted.by_lenses_m)
                                 : "",
                             predicted.fold_factor > 1
                                 ? absl::StrFormat("; parts of the data differ by %.1f times that",
                                                   predicted.fold_factor)
                                 : ""),
                unit * predicted.accepted_m, name,
                input.result.scale_known ? "; or accept more (--accept-mm)" : "")},
           0}};
}

}  // namespace rigcal::server
