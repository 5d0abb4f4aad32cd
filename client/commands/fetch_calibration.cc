// SPDX-License-Identifier: Apache-2.0
#include "client/commands/fetch_calibration.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "client/results/calibration_import.h"

namespace rigcal::client {
namespace {

// The whole of it, as the export `json`.
absl::StatusOr<CalibrationFile> FetchWhole(ServerConnection& server, const std::string& id) {
  v1::ExportCalibrationRequest request;
  request.set_id(id);
  request.set_format("json");
  const auto response = server.Call(&v1::CalibrationService::Stub::ExportCalibration, request);
  if (!response.ok()) return response.status();
  return ParseCalibrationJson(absl::StrCat("calibration ", id), response->content());
}

}  // namespace

absl::StatusOr<CalibrationFile> FetchCalibrationFile(const std::string& which,
                                                     CommandContext& context) {
  if (!IsImportPath(which)) {
    ServerConnection server(context.server);
    return FetchWhole(server, which);
  }
  absl::StatusOr<CalibrationFile> file = ReadCalibration(which);
  if (!file.ok()) return file.status();
  for (const std::string& note : file->notes) {
    context.console.Message(absl::StrCat(which, ": ", note));
  }
  return file;
}

std::vector<double> FetchCovariance(ServerConnection& server, const std::string& id) {
  absl::StatusOr<CalibrationFile> file = FetchWhole(server, id);
  return file.ok() ? std::move(file->camera_covariance) : std::vector<double>();
}

}  // namespace rigcal::client
