// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/source_kind.h"

#include <cmath>
#include <filesystem>

#include "absl/strings/numbers.h"
#include "agent/capture/pacer.h"
#include "common/import/intrinsics_file.h"
#include "common/text/shortest_text.h"

namespace rigcal::agent {
namespace {

// "rig/left/" is the folder "rig/left".
std::filesystem::path WithoutSlash(const std::string& path) {
  const std::filesystem::path with(path);
  return with.has_filename() ? with : with.parent_path();
}

}  // namespace

void AddSpeed(double* speed, OptionTable* table) {
  constexpr double kMaxFactor = 1e6;
  const auto read = [speed](const std::string& text) {
    double factor = 0;
    if (text == "max") {
      *speed = kMaxSpeed;
    } else if (absl::SimpleAtod(text, &factor) && factor > 0 && factor <= kMaxFactor) {
      *speed = factor;
    } else {
      return absl::InvalidArgumentError("must be max or a factor above 0");
    }
    return absl::OkStatus();
  };
  table->Add("speed", "max|FACTOR", "multiple of the recorded pace", read,
             [=] { return std::isinf(*speed) ? "max" : ShortestText(*speed); });
}

void AddCalibration(std::string* path, OptionTable* table) {
  table->AddPath("calibration", path, "the camera's OpenCV YAML, or none");
}

void ResolveCalibration(const std::string& subject, std::string* path) {
  if (*path == "none") {
    path->clear();
  } else if (path->empty() && !subject.empty()) {
    *path = LensFileBeside(WithoutSlash(subject).string());
  }
}

std::string CameraNameOf(const std::string& name, const std::string& path) {
  return name.empty() ? WithoutSlash(path).stem().string() : name;
}

}  // namespace rigcal::agent
