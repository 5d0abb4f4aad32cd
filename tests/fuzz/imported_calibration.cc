// SPDX-License-Identifier: Apache-2.0
// Calibrations of other programs. The first letter says of which.
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>

#include "common/import/import_readers.h"
#include "tests/fuzz/fuzz_check.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  const auto read = data[0] == 'k'   ? &rigcal::ReadKalibr
                    : data[0] == 'c' ? &rigcal::ReadCaliscope
                    : data[0] == 'q' ? &rigcal::ReadQtm
                                     : &rigcal::ReadVicon;
  const auto rig = read("rig.file", text);
  if (!rig.ok()) {
    FUZZ_CHECK(rig.status().code() == absl::StatusCode::kInvalidArgument);
    FUZZ_CHECK(std::string(rig.status().message()).find("rig.file") != std::string::npos);
    return 0;
  }
  FUZZ_CHECK(!rig->cameras.empty());
  for (const rigcal::ImportedCamera& camera : rig->cameras) {
    FUZZ_CHECK(!camera.name.empty());
    FUZZ_CHECK(camera.image_size_px.Validate().ok());
    FUZZ_CHECK(camera.intrinsics.Validate(camera.image_size_px).ok());
    FUZZ_CHECK(std::isfinite(camera.time_offset_s));
    if (!camera.cam_from_rig) continue;
    FUZZ_CHECK(camera.cam_from_rig->Matrix().allFinite());
    FUZZ_CHECK(std::abs(camera.cam_from_rig->rotation.norm() - 1) < 1e-6);
  }
  return 0;
}
