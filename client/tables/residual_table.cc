// SPDX-License-Identifier: Apache-2.0
#include "client/tables/residual_table.h"

#include <algorithm>
#include <cmath>
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

// Upper end of the bin with this share of the counts below it: "0.35", ">4.00" in the last bin.
std::string FormatBinQuantile(const Counts& counts, double bin_px, double share) {
  const auto wanted = static_cast<uint64_t>(std::ceil(share * static_cast<double>(SumOf(counts))));
  if (wanted == 0) return "-";
  uint64_t below = 0;
  int bin = 0;
  while (bin + 1 < counts.size() && below + counts[bin] < wanted) below += counts[bin++];
  const bool is_last = bin + 1 == counts.size();
  return absl::StrCat(is_last ? ">" : "", FormatFixed(bin_px * (is_last ? bin : bin + 1), 3));
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

void AddCamera(const v1::CameraResiduals& camera, TextTable* table) {
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
                 FormatBinQuantile(inliers, camera.bin_px(), 0.5),
                 FormatBinQuantile(inliers, camera.bin_px(), 0.95),
                 used == 0 ? "-" : FormatFixed(dx_px / used, 3),
                 used == 0 ? "-" : FormatFixed(dy_px / used, 3), FormatHistogram(inliers),
                 FormatFixed(camera.bin_px() * inliers.size(), 2)});
}

}  // namespace

std::string FormatResiduals(const v1::GetResidualsResponse& residuals) {
  TextTable table;
  table.Words({"camera"})
      .Numbers({"used", "left out"}, "markers")
      .Numbers({"median", "p95"}, "length (px)")
      .Numbers({"dx", "dy"}, "mean vector (px)")
      .Words({"lengths from 0"})
      .Numbers({"to (px)"});
  for (const v1::CameraResiduals& camera : residuals.cameras()) AddCamera(camera, &table);
  return Printable(absl::StrCat("Projected minus measured markers\n", table.Format(2)));
}

}  // namespace rigcal::client
