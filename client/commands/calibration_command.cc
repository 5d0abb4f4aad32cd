// SPDX-License-Identifier: Apache-2.0
#include "client/commands/calibration_command.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "client/output/output.h"
#include "client/results/calibration_comparison.h"
#include "client/results/calibration_export.h"
#include "client/tables/calibration_table.h"

namespace rigcal::client {
namespace {

using CalibrationStub = v1::CalibrationService::Stub;

absl::StatusOr<v1::Calibration> FetchCalibration(ServerConnection& server, const std::string& id) {
  return CalibrationOf(server.CallWithId(&CalibrationStub::GetCalibration, id));
}

void PrintFiles(const CalibrationExportOptions& options,
                const std::vector<std::filesystem::path>& files, CommandContext& context) {
  if (context.console.format == OutputFormat::kTable) {
    for (const std::filesystem::path& file : files) context.console.out << file.string() << "\n";
    return;
  }
  auto names = nlohmann::ordered_json::array();
  for (const std::filesystem::path& file : files) names.push_back(file.string());
  context.console.out << JsonText({{"calibration", options.id}, {"files", names}}) << "\n";
}

}  // namespace

ExitCode ListCalibrations(const ListOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(ReadAllPages(server, &CalibrationStub::ListCalibrations, options),
                      FormatCalibrationList);
}

ExitCode GetCalibration(const std::string& id, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(FetchCalibration(server, id), FormatCalibration);
}

ExitCode CancelCalibration(const std::string& id, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(CalibrationOf(server.CallWithId(&CalibrationStub::CancelCalibration, id)),
                      FormatCalibration);
}

ExitCode DeleteCalibration(const std::string& id, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(server.CallWithId(&CalibrationStub::DeleteCalibration, id), [&](const auto&) {
    return Printable(absl::StrCat("calibration ", id, " is deleted\n"));
  });
}

ExitCode ExportCalibration(const CalibrationExportOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  const absl::StatusOr<v1::Calibration> calibration = FetchCalibration(server, options.id);
  if (!calibration.ok()) return context.Fail(calibration.status());
  if (options.output == "-") {
    if (absl::Status status = CheckHasResult(*calibration); !status.ok()) {
      return context.Fail(status);
    }
    context.console.out << ToJson(*calibration) << "\n" << std::flush;
    return ExitCode::kOk;
  }
  const auto format = std::ranges::find(ExportFormats(), options.format, &ExportFormat::name);
  const auto files = format->write(*calibration, options.output);
  if (!files.ok()) return context.Fail(files.status());
  PrintFiles(options, *files, context);
  return ExitCode::kOk;
}

ExitCode CompareCalibrations(const CalibrationPair& ids, CommandContext& context) {
  ServerConnection server(context.server);
  const absl::StatusOr<v1::Calibration> a = FetchCalibration(server, ids.a);
  if (!a.ok()) return context.Fail(a.status());
  const absl::StatusOr<v1::Calibration> b = FetchCalibration(server, ids.b);
  if (!b.ok()) return context.Fail(b.status());
  return context.Show(Compare(*a, *b), FormatComparison);
}

}  // namespace rigcal::client
