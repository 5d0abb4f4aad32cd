// SPDX-License-Identifier: Apache-2.0
#include "client/commands/calibration_command.h"

#include <nlohmann/json.hpp>

#include "client/commands/calibrate_command.h"
#include "client/net/paging.h"
#include "client/net/resources.h"
#include "client/net/server_connection.h"
#include "client/output/output.h"
#include "client/results/calibration_comparison.h"
#include "client/results/calibration_export.h"
#include "client/tables/calibration_table.h"

namespace rigcal::client {
namespace {

using CalibrationStub = v1::CalibrationService::Stub;

absl::StatusOr<v1::Calibration> FetchCalibration(ServerConnection& server, const std::string& id) {
  v1::GetCalibrationRequest request;
  request.set_id(id);
  return CalibrationOf(
      server.Call(server.calibrations(), &CalibrationStub::GetCalibration, request));
}

void PrintFiles(const CalibrationExportOptions& options,
                const std::vector<std::filesystem::path>& files, CommandContext& context) {
  if (context.console.format == OutputFormat::kTable) {
    for (const std::filesystem::path& file : files) context.console.out << file.string() << "\n";
    return;
  }
  using Json = nlohmann::ordered_json;
  Json names = Json::array();
  for (const std::filesystem::path& file : files) names.push_back(file.string());
  const Json json = {{"calibration", options.id}, {"files", names}};
  context.console.out << json.dump(1, ' ', false, Json::error_handler_t::replace) << "\n";
}

}  // namespace

ExitCode ListCalibrations(const ListOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  const auto calibrations = ReadAllPages<v1::ListCalibrationsRequest, v1::ListCalibrationsResponse>(
      [&](const v1::ListCalibrationsRequest& request) {
        return server.Call(server.calibrations(), &CalibrationStub::ListCalibrations,
                           WithListOptions(request, options));
      },
      [](v1::ListCalibrationsResponse& all, v1::ListCalibrationsResponse& page) {
        for (v1::Calibration& calibration : *page.mutable_calibrations()) {
          all.add_calibrations()->Swap(&calibration);
        }
      });
  if (!calibrations.ok()) return context.Fail(calibrations.status());
  if (context.console.format == OutputFormat::kJson) {
    PrintJson(context.console, *calibrations);
  } else {
    context.console.out << FormatCalibrationList(calibrations->calibrations());
  }
  return ExitCode::kOk;
}

ExitCode GetCalibration(const std::string& id, CommandContext& context) {
  ServerConnection server(context.server);
  const absl::StatusOr<v1::Calibration> calibration = FetchCalibration(server, id);
  if (!calibration.ok()) return context.Fail(calibration.status());
  if (context.console.format == OutputFormat::kJson) {
    PrintJson(context.console, *calibration);
  } else {
    context.console.out << FormatCalibration(*calibration);
  }
  return ExitCode::kOk;
}

ExitCode CancelCalibration(const std::string& id, CommandContext& context) {
  ServerConnection server(context.server);
  v1::CancelCalibrationRequest request;
  request.set_id(id);
  const auto calibration = CalibrationOf(
      server.Call(server.calibrations(), &CalibrationStub::CancelCalibration, request));
  if (!calibration.ok()) return context.Fail(calibration.status());
  if (context.console.format == OutputFormat::kJson) {
    PrintJson(context.console, *calibration);
  } else {
    context.console.out << FormatCalibration(*calibration);
  }
  return ExitCode::kOk;
}

ExitCode DeleteCalibration(const std::string& id, CommandContext& context) {
  ServerConnection server(context.server);
  v1::DeleteCalibrationRequest request;
  request.set_id(id);
  const auto response =
      server.Call(server.calibrations(), &CalibrationStub::DeleteCalibration, request);
  if (!response.ok()) return context.Fail(response.status());
  if (context.console.format == OutputFormat::kJson) {
    PrintJson(context.console, *response);
  } else {
    context.console.out << "calibration " << Printable(id) << " is deleted\n";
  }
  return ExitCode::kOk;
}

ExitCode ExportCalibration(const CalibrationExportOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  const absl::StatusOr<v1::Calibration> calibration = FetchCalibration(server, options.id);
  if (!calibration.ok()) return context.Fail(calibration.status());
  if (options.output == "-") {
    if (absl::Status status = CheckHasResult(*calibration); !status.ok()) {
      return context.Fail(status);
    }
    PrintJson(context.console, *calibration);
    return ExitCode::kOk;
  }
  const auto files = options.format == ExportFormat::kOpenCv
                         ? ExportOpenCv(*calibration, options.output)
                         : ExportJson(*calibration, options.output);
  if (!files.ok()) return context.Fail(files.status());
  PrintFiles(options, *files, context);
  return ExitCode::kOk;
}

ExitCode CompareCalibrations(const std::string& a, const std::string& b, CommandContext& context) {
  ServerConnection server(context.server);
  const absl::StatusOr<v1::Calibration> calibration_a = FetchCalibration(server, a);
  if (!calibration_a.ok()) return context.Fail(calibration_a.status());
  const absl::StatusOr<v1::Calibration> calibration_b = FetchCalibration(server, b);
  if (!calibration_b.ok()) return context.Fail(calibration_b.status());
  const auto comparison = Compare(*calibration_a, *calibration_b);
  if (!comparison.ok()) return context.Fail(comparison.status());
  if (context.console.format == OutputFormat::kJson) {
    context.console.out << ComparisonJson(*comparison) << "\n";
  } else {
    context.console.out << FormatComparison(*comparison);
  }
  return ExitCode::kOk;
}

}  // namespace rigcal::client
