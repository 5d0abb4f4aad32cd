// SPDX-License-Identifier: Apache-2.0
#include "client/commands/rig_command.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "client/tables/rig_table.h"
#include "rigcal/v1/rig_service.grpc.pb.h"

namespace rigcal::client {
namespace {

using RigStub = v1::RigService::Stub;

absl::StatusOr<v1::Rig> FetchRig(ServerConnection& server, const std::string& name) {
  v1::GetRigRequest request;
  request.set_name(name);
  auto response = server.Call(&RigStub::GetRig, request);
  if (!response.ok()) return response.status();
  return std::move(*response->mutable_rig());
}

}  // namespace

ExitCode ListRigs(const NoOptions&, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(server.Call(&RigStub::ListRigs, v1::ListRigsRequest()), FormatRigList);
}

ExitCode GetRig(const std::string& name, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(FetchRig(server, name), FormatRig);
}

ExitCode ShowHistory(const std::string& name, CommandContext& context) {
  ServerConnection server(context.server);
  v1::ListActivationsRequest request;
  request.set_rig(name);
  return context.Show(server.Call(&RigStub::ListActivations, request), FormatHistory);
}

absl::StatusOr<v1::Activation> Activate(ServerConnection& server, const std::string& id,
                                        const std::string& reason, bool force) {
  v1::ActivateCalibrationRequest request;
  request.set_id(id);
  request.set_reason(reason);
  request.set_force(force);
  auto response = server.Call(&RigStub::ActivateCalibration, request);
  if (!response.ok()) return response.status();
  return std::move(*response->mutable_activation());
}

ExitCode ActivateCalibration(const ActivateOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(Activate(server, options.id, options.reason, options.force),
                      FormatActivation);
}

ExitCode RollbackRig(const ActivateOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  v1::RollbackRigRequest request;
  request.set_name(options.id);
  request.set_reason(options.reason);
  request.set_force(options.force);
  const auto response = server.Call(&RigStub::RollbackRig, request);
  if (!response.ok()) return context.Fail(response.status());
  return context.Show(absl::StatusOr<v1::Activation>(response->activation()), FormatActivation);
}

absl::StatusOr<std::string> ActiveCalibrationOf(ServerConnection& server, const std::string& rig) {
  const absl::StatusOr<v1::Rig> found = FetchRig(server, rig);
  if (!found.ok()) return found.status();
  if (!found->active_calibration_id().empty()) return found->active_calibration_id();
  return absl::FailedPreconditionError(
      absl::StrCat("rig '", rig,
                   "' has no active calibration; `rigcal rig activate ID` makes one "
                   "so, or name one with --parent"));
}

absl::StatusOr<v1::CompareCalibrationsResponse> FetchDifference(ServerConnection& server,
                                                                const std::string& id_a,
                                                                const std::string& id_b) {
  v1::CompareCalibrationsRequest request;
  request.set_id_a(id_a);
  request.set_id_b(id_b);
  return server.Call(&v1::CalibrationService::Stub::CompareCalibrations, request);
}

ExitCode DiffCalibrations(const CalibrationPair& ids, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(FetchDifference(server, ids.a, ids.b), FormatDifference);
}

}  // namespace rigcal::client
