// SPDX-License-Identifier: Apache-2.0
#include "client/results/trc_file.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace rigcal::client {
namespace {

std::string TrcHeader(const PointFrames& frames, const std::string& name) {
  const std::string rate = absl::StrFormat("%.9g", frames.rate_hz);
  std::string text = absl::StrCat(
      "PathFileType\t4\t(X/Y/Z)\t", name,
      "\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\t"
      "OrigNumFrames\n",
      rate, "\t", rate, "\t", frames.frame_count, "\t", frames.labels.size(), "\tmm\t", rate,
      "\t1\t", frames.frame_count, "\nFrame#\tTime");
  for (const std::string& label : frames.labels) absl::StrAppend(&text, "\t", label, "\t\t");
  text += "\n\t";
  for (size_t i = 1; i <= frames.labels.size(); ++i) {
    absl::StrAppend(&text, "\tX", i, "\tY", i, "\tZ", i);
  }
  return text + "\n\n";
}

}  // namespace

std::string TrcFile(const PointFrames& frames, const std::string& name) {
  std::string text = TrcHeader(frames, name);
  const size_t markers = frames.labels.size();
  for (size_t frame = 0; frame < frames.frame_count; ++frame) {
    absl::StrAppendFormat(&text, "%d\t%.6f", frame + 1,
                          static_cast<double>(frame) / frames.rate_hz);
    for (size_t marker = 0; marker < markers; ++marker) {
      const TriangulatedPoint* const point = frames.points[frame * markers + marker];
      if (point == nullptr) {
        text += "\t\t\t";
        continue;
      }
      const Eigen::Vector3d at_mm = 1000 * point->position_m;
      absl::StrAppendFormat(&text, "\t%.5f\t%.5f\t%.5f", at_mm.x(), at_mm.y(), at_mm.z());
    }
    text += "\n";
  }
  return text;
}

}  // namespace rigcal::client
