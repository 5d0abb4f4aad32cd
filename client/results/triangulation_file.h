// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "common/calibration/calibration.h"
#include "common/triangulate/triangulate_rows.h"

namespace rigcal::client {

// A line for each point: `time_s,label,x_m,y_m,z_m,sigma_x_m,sigma_y_m,sigma_z_m,cov_xy_m2,
// cov_xz_m2,cov_yz_m2,cameras,error_px`, in the rig frame and rig time. `rigcal evaluate` reads it.
std::string TriangulationCsv(const Triangulation& triangulation,
                             const std::vector<std::string>& labels);
std::string TriangulationCsvHeader();
std::string TriangulationCsvLine(const TriangulatedPoint& point, const std::string& label);

// The same as an Apache Parquet file, but for `time_ns`, an integer, in place of `time_s`: doubles
// as they are, not rounded. `calibration` is noted in the file's metadata.
std::string TriangulationParquet(const Triangulation& triangulation,
                                 const std::vector<std::string>& labels,
                                 const std::string& calibration);

// Labels of the markers of a target: those of its points, else 0, 1, 2, ...
std::vector<std::string> MarkerLabels(const Target& target, size_t marker_count);

// A distance between neighbouring markers of a wand as triangulated, against the calibration's.
struct TriangulatedSpan {
  double length_m = 0;  // of the calibrated wand
  double mean_error_m = 0, error_rms_m = 0;
  uint32_t count = 0;
};

// What a run came to.
struct TriangulationSummary {
  std::string calibration;
  std::string output;  // file
  uint32_t instant_count = 0, point_count = 0;
  std::map<int, uint32_t> points_by_cameras;  // number of cameras -> points
  double median_error_px = 0, median_sigma_m = 0, median_noise_sigma_m = 0;
  bool has_calibration_covariance = false;
  uint32_t alone_count = 0, no_ray_count = 0, disagree_count = 0;
  std::map<std::string, uint32_t> left_out;  // by camera
  std::vector<TriangulatedSpan> spans;       // of a wand
};

TriangulationSummary Summarise(const CalibrationResult& calibration,
                               const Triangulation& triangulation);
std::string FormatTriangulation(const TriangulationSummary& summary);
std::string ToJson(const TriangulationSummary& summary);

}  // namespace rigcal::client
