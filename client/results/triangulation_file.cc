// SPDX-License-Identifier: Apache-2.0
#include "client/results/triangulation_file.h"

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/output/console.h"
#include "client/output/output.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"
#include "client/results/parquet_file.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::client {
namespace {

// Exact to the nanosecond, also of times since 1970.
std::string SecondsText(int64_t time_ns) {
  const char* sign = time_ns < 0 ? "-" : "";
  const uint64_t ns =
      time_ns < 0 ? 0 - static_cast<uint64_t>(time_ns) : static_cast<uint64_t>(time_ns);
  return absl::StrFormat("%s%d.%09d", sign, ns / 1'000'000'000, ns % 1'000'000'000);
}

std::vector<TriangulatedSpan> SpansOf(const CalibrationResult& calibration,
                                      const Triangulation& triangulation) {
  const std::vector<double>& positions_m = calibration.target.marker_positions_m;
  std::vector<TriangulatedSpan> spans(positions_m.size() > 1 ? positions_m.size() - 1 : 0);
  const std::vector<TriangulatedPoint>& points = triangulation.points;
  for (size_t i = 1; i < points.size(); ++i) {
    const TriangulatedPoint &a = points[i - 1], &b = points[i];
    const auto span = static_cast<size_t>(a.marker);
    if (a.rig_time_ns != b.rig_time_ns || b.marker != a.marker + 1 || span >= spans.size()) {
      continue;
    }
    const double length_m = positions_m[span + 1] - positions_m[span];
    const double error_m = (b.position_m - a.position_m).norm() - length_m;
    spans[span].length_m = length_m;
    spans[span].mean_error_m += error_m;
    spans[span].error_rms_m += error_m * error_m;
    ++spans[span].count;
  }
  for (TriangulatedSpan& span : spans) {
    if (span.count == 0) continue;
    span.mean_error_m /= span.count;
    span.error_rms_m = std::sqrt(span.error_rms_m / span.count);
  }
  return spans;
}

std::string MillimetresOf(double metres) { return FormatFixed(1000 * metres, 3); }

}  // namespace

std::string TriangulationCsvHeader() {
  return "time_s,label,x_m,y_m,z_m,sigma_x_m,sigma_y_m,sigma_z_m,cov_xy_m2,cov_xz_m2,cov_yz_m2,"
         "cameras,error_px\n";
}

std::string TriangulationCsvLine(const TriangulatedPoint& point, const std::string& label) {
  const Eigen::Vector3d& at = point.position_m;
  const Eigen::Matrix3d& covariance = point.covariance_m2;
  const Eigen::Vector3d sigma = covariance.diagonal().cwiseSqrt();
  return absl::StrFormat("%s,%s,%.7f,%.7f,%.7f,%.3g,%.3g,%.3g,%.4g,%.4g,%.4g,%d,%.3f\n",
                         SecondsText(point.rig_time_ns), label, at.x(), at.y(), at.z(), sigma.x(),
                         sigma.y(), sigma.z(), covariance(0, 1), covariance(0, 2), covariance(1, 2),
                         point.views.size(), point.error_px);
}

std::string TriangulationCsv(const Triangulation& triangulation,
                             const std::vector<std::string>& labels) {
  std::string csv = TriangulationCsvHeader();
  for (const TriangulatedPoint& point : triangulation.points) {
    absl::StrAppend(&csv, TriangulationCsvLine(point, labels[static_cast<size_t>(point.marker)]));
  }
  return csv;
}

std::string TriangulationParquet(const Triangulation& triangulation,
                                 const std::vector<std::string>& labels,
                                 const std::string& calibration) {
  std::vector<int64_t> times_ns;
  std::vector<std::string> point_labels;
  std::vector<int32_t> cameras;
  std::vector<double> errors_px;
  std::array<std::vector<double>, 9> numbers;
  for (const TriangulatedPoint& point : triangulation.points) {
    const Eigen::Vector3d& at = point.position_m;
    const Eigen::Matrix3d& covariance = point.covariance_m2;
    const Eigen::Vector3d sigma = covariance.diagonal().cwiseSqrt();
    times_ns.push_back(point.rig_time_ns);
    point_labels.push_back(labels[static_cast<size_t>(point.marker)]);
    const double values[] = {at.x(),           at.y(),           at.z(),
                             sigma.x(),        sigma.y(),        sigma.z(),
                             covariance(0, 1), covariance(0, 2), covariance(1, 2)};
    for (size_t i = 0; i < numbers.size(); ++i) numbers[i].push_back(values[i]);
    cameras.push_back(static_cast<int32_t>(point.views.size()));
    errors_px.push_back(point.error_px);
  }
  constexpr const char* kNames[] = {"x_m",       "y_m",       "z_m",       "sigma_x_m", "sigma_y_m",
                                    "sigma_z_m", "cov_xy_m2", "cov_xz_m2", "cov_yz_m2"};
  std::vector<ParquetColumn> columns = {{"time_ns", std::move(times_ns)},
                                        {"label", std::move(point_labels)}};
  for (size_t i = 0; i < numbers.size(); ++i) columns.push_back({kNames[i], std::move(numbers[i])});
  columns.push_back({"cameras", std::move(cameras)});
  columns.push_back({"error_px", std::move(errors_px)});
  return ParquetFile(columns, {{"calibration", calibration}, {"frame", "rig"}, {"time", "rig"}});
}

std::vector<std::string> MarkerLabels(const Target& target, size_t marker_count) {
  std::vector<std::string> labels;
  for (size_t i = 0; i < marker_count; ++i) {
    labels.push_back(i < target.points.size() ? target.points[i].label : absl::StrCat(i));
  }
  return labels;
}

TriangulationSummary Summarise(const CalibrationResult& calibration,
                               const Triangulation& triangulation) {
  TriangulationSummary summary;
  summary.has_calibration_covariance = triangulation.has_calibration_covariance;
  summary.alone_count = triangulation.alone_count;
  summary.no_ray_count = triangulation.no_ray_count;
  summary.disagree_count = triangulation.disagree_count;
  summary.left_out = triangulation.left_out;
  summary.point_count = static_cast<uint32_t>(triangulation.points.size());
  std::set<int64_t> instants;
  std::vector<double> errors_px, sigmas_m, noises_m;
  for (const TriangulatedPoint& point : triangulation.points) {
    instants.insert(point.rig_time_ns);
    ++summary.points_by_cameras[static_cast<int>(point.views.size())];
    errors_px.push_back(point.error_px);
    sigmas_m.push_back(std::sqrt(point.covariance_m2.trace()));
    noises_m.push_back(std::sqrt(point.noise_m2.trace()));
  }
  summary.instant_count = static_cast<uint32_t>(instants.size());
  if (!errors_px.empty()) {
    summary.median_error_px = UpperMedian(&errors_px);
    summary.median_sigma_m = UpperMedian(&sigmas_m);
    summary.median_noise_sigma_m = UpperMedian(&noises_m);
  }
  summary.spans = SpansOf(calibration, triangulation);
  return summary;
}

std::string FormatTriangulation(const TriangulationSummary& summary) {
  std::string text = absl::StrCat(FormatCount(summary.point_count, "point"), " at ",
                                  FormatCount(summary.instant_count, "instant"), ", written to ",
                                  summary.output, "\n");
  for (const auto& [cameras, points] : summary.points_by_cameras) {
    absl::StrAppend(&text, "  from ", FormatCount(static_cast<uint64_t>(cameras), "camera"), ": ",
                    points, "\n");
  }
  absl::StrAppend(&text, "median reprojection error ", FormatFixed(summary.median_error_px, 3),
                  " px\nmedian sigma (3-D)        ", MillimetresOf(summary.median_sigma_m),
                  " mm, of which the centres' noise ", MillimetresOf(summary.median_noise_sigma_m),
                  " mm\n");
  if (!summary.has_calibration_covariance) {
    absl::StrAppend(&text,
                    "the file has no covariance of the calibration: its part is missing in the "
                    "sigmas\n");
  }
  absl::StrAppend(&text, "no point: ", FormatCount(summary.alone_count, "marker"),
                  " that one camera saw, ", summary.no_ray_count, " with parallel rays, ",
                  summary.disagree_count, " whose cameras do not agree\n");
  for (const auto& [camera, count] : summary.left_out) {
    absl::StrAppend(&text, "left out of ", Printable(camera), ": ", FormatCount(count, "centre"),
                    " not in agreement with the others\n");
  }
  TextTable table;
  table.Numbers({"span (mm)", "mean error", "rms error", "count"});
  for (const TriangulatedSpan& span : summary.spans) {
    if (span.count == 0) continue;
    table.AddRow({FormatFixed(1000 * span.length_m, 2), MillimetresOf(span.mean_error_m),
                  MillimetresOf(span.error_rms_m), span.count});
  }
  if (!table.empty()) {
    absl::StrAppend(&text, "Spans of the wand, triangulated minus calibrated, mm\n",
                    table.Format(2));
  }
  return text;
}

std::string ToJson(const TriangulationSummary& summary) {
  nlohmann::ordered_json json = {{"calibration", summary.calibration},
                                 {"output", summary.output},
                                 {"instants", summary.instant_count},
                                 {"points", summary.point_count},
                                 {"points_by_cameras", nlohmann::ordered_json::object()},
                                 {"median_error_px", summary.median_error_px},
                                 {"median_sigma_m", summary.median_sigma_m},
                                 {"median_noise_sigma_m", summary.median_noise_sigma_m},
                                 {"has_calibration_covariance", summary.has_calibration_covariance},
                                 {"alone", summary.alone_count},
                                 {"no_ray", summary.no_ray_count},
                                 {"disagree", summary.disagree_count},
                                 {"left_out", nlohmann::ordered_json::object()},
                                 {"spans", nlohmann::ordered_json::array()}};
  for (const auto& [cameras, points] : summary.points_by_cameras) {
    json["points_by_cameras"][absl::StrCat(cameras)] = points;
  }
  for (const auto& [camera, count] : summary.left_out) json["left_out"][camera] = count;
  for (const TriangulatedSpan& span : summary.spans) {
    json["spans"].push_back({{"length_m", span.length_m},
                             {"mean_error_m", span.mean_error_m},
                             {"error_rms_m", span.error_rms_m},
                             {"count", span.count}});
  }
  return JsonText(json);
}

}  // namespace rigcal::client
