// SPDX-License-Identifier: Apache-2.0
// Calibration files of cameras: YAML of OpenCV, ROS and kalibr, and what else begins like XML or
// JSON.
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>

#include "common/import/intrinsics_file.h"
#include "tests/fuzz/fuzz_check.h"
#include "tests/fuzz/fuzz_folder.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const rigcal::testing::FuzzFolder folder;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const std::string path = folder.WriteFile("camera.yaml", text);
  const auto file = rigcal::ReadIntrinsicsFile(path);
  if (!file.ok()) {
    FUZZ_CHECK(file.status().code() == absl::StatusCode::kInvalidArgument);
    FUZZ_CHECK(std::string(file.status().message()).find(path) != std::string::npos);
    return 0;
  }
  FUZZ_CHECK(file->image_size_px.width > 0 && file->image_size_px.height > 0);
  const rigcal::Intrinsics& intrinsics = file->intrinsics;
  FUZZ_CHECK(std::isfinite(intrinsics.fx_px) && intrinsics.fx_px > 0);
  FUZZ_CHECK(std::isfinite(intrinsics.fy_px) && intrinsics.fy_px > 0);
  FUZZ_CHECK(std::isfinite(intrinsics.cx_px) && std::isfinite(intrinsics.cy_px));
  for (const double coefficient : intrinsics.distortion) FUZZ_CHECK(std::isfinite(coefficient));
  return 0;
}
