// SPDX-License-Identifier: Apache-2.0
#include "client/commands/triangulate_stream.h"

#include <limits>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/net/server_connection.h"
#include "client/output/quantities.h"
#include "client/results/triangulation_file.h"
#include "common/target/csv_line.h"
#include "rigcal/v1/triangulation_service.grpc.pb.h"

namespace rigcal::client {
namespace {

constexpr double kSigmaOfNoUsePx = 1;  // the server has its own
constexpr size_t kMaxLineBytes = 8192;

v1::TriangulateRequest StartRequest(const TriangulateCommandOptions& options) {
  v1::TriangulateRequest request;
  v1::TriangulateStart& start = *request.mutable_start();
  start.set_calibration_id(options.calibration);
  start.set_sigma_px(options.triangulation.sigma_px);
  start.set_max_sigmas(options.triangulation.max_sigmas);
  if (options.diameter_m) start.set_diameter_m(*options.diameter_m);
  return request;
}

// A line to a message. False: it is no row, and `left_out` is counted.
bool RowRequest(const std::string& line, int* marker_count, v1::TriangulateRequest* request) {
  const size_t end = line.find(';');
  if (end == std::string::npos || end == 0 || line.size() > kMaxLineBytes) return false;
  const std::string row_text = line.substr(end + 1);
  if (*marker_count == 0) *marker_count = (CsvFieldCount(row_text) - 1) / 2;
  Observation row;
  if (*marker_count < 1 || ParseCsvLine(row_text, *marker_count, kSigmaOfNoUsePx, &row)) {
    return false;
  }
  v1::TriangulateRows& rows = *request->mutable_rows();
  rows.set_camera(line.substr(0, end));
  rows.set_marker_count(static_cast<uint32_t>(*marker_count));
  rows.add_time_ns(row.time_ns);
  constexpr float kNotSeen = std::numeric_limits<float>::quiet_NaN();
  for (const MarkerObservation& marker : row.markers) {
    rows.add_x_px(marker.visible ? static_cast<float>(marker.centre_px.x()) : kNotSeen);
    rows.add_y_px(marker.visible ? static_cast<float>(marker.centre_px.y()) : kNotSeen);
  }
  return true;
}

TriangulatedPoint PointOf(const v1::TriangulatedPoint& proto) {
  TriangulatedPoint point;
  point.rig_time_ns = proto.time_ns();
  point.marker = static_cast<int>(proto.marker());
  point.position_m = {proto.position_m().x(), proto.position_m().y(), proto.position_m().z()};
  int next = 0;
  for (int row = 0; row < 3; ++row) {
    for (int column = row; column < 3 && next < proto.covariance_m2_size(); ++column) {
      const double value = proto.covariance_m2(next++);
      point.covariance_m2(row, column) = point.covariance_m2(column, row) = value;
    }
  }
  point.views.resize(proto.camera_count());
  point.error_px = proto.error_px();
  return point;
}

}  // namespace

ExitCode TriangulateLines(const TriangulateCommandOptions& options, std::istream& lines,
                          CommandContext& context) {
  ServerConnection server(context.server);
  bool started = false;
  int marker_count = 0;
  uint64_t unreadable = 0;
  const auto next = [&](v1::TriangulateRequest* request) {
    if (!std::exchange(started, true)) {
      *request = StartRequest(options);
      return true;
    }
    for (std::string line; std::getline(lines, line);) {
      request->Clear();
      if (RowRequest(line, &marker_count, request)) return true;
      ++unreadable;
    }
    return false;
  };
  std::vector<std::string> labels;
  v1::TriangulateCounts counts;
  const auto each = [&](const v1::TriangulateResponse& response) {
    if (response.has_started()) {
      labels.assign(response.started().labels().begin(), response.started().labels().end());
      context.console.out << TriangulationCsvHeader() << std::flush;
    }
    if (response.has_counts()) counts = response.counts();
    for (const v1::TriangulatedPoint& point : response.points()) {
      const std::string label =
          point.marker() < labels.size() ? labels[point.marker()] : absl::StrCat(point.marker());
      context.console.out << TriangulationCsvLine(PointOf(point), label);
    }
    context.console.out << std::flush;
    return context.console.out.good();
  };
  const absl::Status status =
      server.Exchange(&v1::TriangulationService::Stub::Triangulate, next, each);
  if (!status.ok()) return context.Fail(status);
  context.console.Message(absl::StrCat(
      FormatCount(counts.points(), "point"), "; no point: ", FormatCount(counts.alone(), "marker"),
      " that one camera saw, ", counts.no_ray(), " with parallel rays, ", counts.disagree(),
      " whose cameras do not agree; left out: ", FormatCount(counts.left_out(), "centre"), ", ",
      FormatCount(counts.late_rows(), "late row"), ", ",
      FormatCount(unreadable, "unreadable line")));
  return ExitCode::kOk;
}

}  // namespace rigcal::client
