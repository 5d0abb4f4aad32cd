// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/calibration_service.h"

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/calibration_wire.h"
#include "server/rpc/accuracy_messages.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/list_arguments.h"

namespace rigcal::server {
namespace {

constexpr FilterField kCalibrationFilterFields[] = {
    {"rig"}, {"state"}, {.name = "session_ids", .repeated = true}};
constexpr ListFields kCalibrationFields = {.filter = kCalibrationFilterFields,
                                           .time_order = "create_time",
                                           .id_order = "id",
                                           .default_order = RecordOrder::kNewestFirst};

absl::StatusOr<CalibrationState> ParseCalibrationState(const std::string& name) {
  v1::Calibration::State state = v1::Calibration::STATE_UNSPECIFIED;
  if (v1::Calibration::State_Parse(name, &state) && state != v1::Calibration::STATE_UNSPECIFIED) {
    return static_cast<CalibrationState>(state);
  }
  return absl::InvalidArgumentError(
      absl::StrCat("filter: state is '", name,
                   "'; it is STATE_QUEUED, STATE_RUNNING, STATE_SUCCEEDED or STATE_FAILED"));
}

}  // namespace

grpc::Status CalibrationService::CreateCalibration(grpc::ServerContext* /*context*/,
                                                   const v1::CreateCalibrationRequest* request,
                                                   v1::CreateCalibrationResponse* response) {
  return GuardedCall("CreateCalibration", [&]() -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(CalibrationOptions options, wire::FromProto(request->options()));
    RIGCAL_ASSIGN_OR_RETURN(
        const Calibration calibration,
        runner_.CreateCalibration({request->session_ids().begin(), request->session_ids().end()},
                                  std::move(options)));
    *response->mutable_calibration() = wire::ToProto(calibration);
    return absl::OkStatus();
  });
}

grpc::Status CalibrationService::GetCalibration(grpc::ServerContext* /*context*/,
                                                const v1::GetCalibrationRequest* request,
                                                v1::GetCalibrationResponse* response) {
  return GuardedCall("GetCalibration", [&]() -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(const Calibration calibration, runner_.GetCalibration(request->id()));
    *response->mutable_calibration() = wire::ToProto(calibration);
    return absl::OkStatus();
  });
}

grpc::Status CalibrationService::ListCalibrations(grpc::ServerContext* /*context*/,
                                                  const v1::ListCalibrationsRequest* request,
                                                  v1::ListCalibrationsResponse* response) {
  return GuardedCall("ListCalibrations", [&]() -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(const ListArguments list,
                            ParseListArguments(*request, kCalibrationFields));
    CalibrationFilter filter;
    for (const ListArguments::Term& term : list.filter) {
      if (term.field == "rig") {
        filter.rig = term.value;
      } else if (term.field == "session_ids") {
        filter.session_id = term.value;
      } else {
        RIGCAL_ASSIGN_OR_RETURN(filter.state, ParseCalibrationState(term.value));
      }
    }
    RIGCAL_ASSIGN_OR_RETURN(const auto calibrations, runner_.ListCalibrations(filter, list.Page()));
    PageFiller page(list);
    for (const Listed<Calibration>& listed : calibrations) {
      if (page.full()) {
        response->set_next_page_token(page.NextToken());
        break;
      }
      v1::Calibration proto = wire::ToProto(listed.record);
      proto.clear_cameras();
      proto.clear_refused();
      page.Add(listed.position, proto.ByteSizeLong());
      *response->add_calibrations() = std::move(proto);
    }
    return absl::OkStatus();
  });
}

grpc::Status CalibrationService::CancelCalibration(grpc::ServerContext* /*context*/,
                                                   const v1::CancelCalibrationRequest* request,
                                                   v1::CancelCalibrationResponse* response) {
  return GuardedCall("CancelCalibration", [&]() -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(const Calibration calibration,
                            runner_.CancelCalibration(request->id()));
    *response->mutable_calibration() = wire::ToProto(calibration);
    return absl::OkStatus();
  });
}

grpc::Status CalibrationService::DeleteCalibration(grpc::ServerContext* /*context*/,
                                                   const v1::DeleteCalibrationRequest* request,
                                                   v1::DeleteCalibrationResponse* /*response*/) {
  return GuardedCall("DeleteCalibration", [&] { return runner_.DeleteCalibration(request->id()); });
}

grpc::ServerWriteReactor<v1::WatchCalibrationResponse>* CalibrationService::WatchCalibration(
    grpc::CallbackServerContext* /*context*/, const v1::WatchCalibrationRequest* request) {
  const std::string id = request->id();
  return watches_.Open<v1::WatchCalibrationResponse>(
      [&](std::function<void()> wake) { return runner_.WatchCalibration(id, std::move(wake)); },
      [this, id](v1::WatchCalibrationResponse* response) -> absl::StatusOr<bool> {
        RIGCAL_ASSIGN_OR_RETURN(const Calibration calibration, runner_.GetCalibration(id));
        *response->mutable_calibration() = wire::ToProto(calibration);
        return calibration.state == CalibrationState::kSucceeded ||
               calibration.state == CalibrationState::kFailed;
      });
}

grpc::Status CalibrationService::GetAccuracy(grpc::ServerContext* /*context*/,
                                             const v1::GetAccuracyRequest* request,
                                             v1::GetAccuracyResponse* response) {
  return GuardedCall("GetAccuracy", [&]() -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(const Calibration calibration, runner_.GetCalibration(request->id()));
    RIGCAL_ASSIGN_OR_RETURN(*response, AccuracyOf(calibration, *request));
    return absl::OkStatus();
  });
}

}  // namespace rigcal::server
