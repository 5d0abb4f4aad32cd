// SPDX-License-Identifier: Apache-2.0
#include "client/tables/residual_table.h"

#include <algorithm>
#include <numeric>

#include "absl/strings/str_cat.h"
#include "client/output/console.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"

namespace rigcal::client {
namespace {

using Counts = google::protobuf::RepeatedField<uint32_t>;

uint64_t SumOf(const Counts& counts) {
  return std::accumulate(counts.begin(), counts.end(), uint64_t{0});
}

// One character for two bins; the taller, the denser.
std::string FormatHistogram(const Counts& counts) {
  constexpr std::string_view kLevels = " .:-=+*#%@";
  std::vector<uint64_t> pairs;
  for (int i = 0; i < counts.size(); i += 2) {
    pairs.push_back(uint64_t{counts[i]} + (i + 1 < counts.size() ? counts[i + 1] : 0));
  }
  const uint64_t most = pairs.empty() ? 0 : *std::ranges::max_element(pairs);
  std::string text;
  for (const uint64_t count : pairs) {
    // Above zero is never a space.
    text += kLevels[most == 0 ? 0 : (count * (kLevels.size() - 1) + most - 1) / most];
  }
  return absl::StrCat("|", text, "|");
}

// As the calibration has them; 0: it does not.
v1::ErrorFigures FiguresOf(const v1::Calibration& calibration, const std::string& name) {
  for (const v1::CalibratedCamera& camera : calibration.cameras()) {
    if (camera.camera() == name) return camera.residuals().inlier();
  }
  return {};
}

void AddCamera(const v1::CameraResiduals& camera, const v1::Calibration& calibration,
               TextTable* table) {
  const v1::ErrorFigures figures = FiguresOf(calibration, camera.camera());
  const auto figure = [](double value_px) {
    return value_px > 0 ? FormatFixed(value_px, 3) : std::string("-");
  };
  double dx_px = 0, dy_px = 0;
  int used = 0;
  const int count = std::min({camera.dx_px_size(), camera.dy_px_size(), camera.outlier_size()});
  for (int i = 0; i < count; ++i) {
    if (camera.outlier(i)) continue;
    dx_px += camera.dx_px(i);
    dy_px += camera.dy_px(i);
    ++used;
  }
  const Counts& inliers = camera.inlier_counts();
  table->AddRow({camera.camera(), SumOf(inliers), SumOf(camera.outlier_counts()),
                 figure(figures.mean_px()), figure(figures.median_px()), figure(figures.p95_px()),
                 used == 0 ? "-" : FormatFixed(dx_px / used, 3),
                 used == 0 ? "-" : FormatFixed(dy_px / used, 3), FormatHistogram(inliers),
                 FormatFixed(camera.bin_px() * inliers.size(), 2)});
}

}  // namespace

std::string FormatResiduals(const v1::GetResidualsResponse& residuals,
                            const v1::Calibration& calibration) {
  TextTable table;
  table.Words({"camera"})
      .Numbers({"used", "left out"}, "markers")
      .Numbers({"mean", "median", "p95"}, "of the markers used (px)")
      .Numbers({"dx", "dy"}, "mean vector (px)")
      .Words({"lengths from 0"})
      .Numbers({"to (px)"});
  for (const v1::CameraResiduals& camera : residuals.cameras()) {
    AddCamera(camera, calibration, &table);
  }
  return Printable(absl::StrCat("Projected minus measured markers\n", table.Format(2)));
}

}  // namespace rigcal::client
