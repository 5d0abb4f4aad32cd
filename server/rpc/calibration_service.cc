// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/calibration_service.h"

#include <string>
#include <utility>
#include <vector>

#include "common/status/status_macros.h"
#include "common/wire/calibration_wire.h"
#include "server/rpc/accuracy_messages.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/page.h"
#include "server/rpc/watch_loop.h"

namespace rigcal::server {

grpc::Status CalibrationService::CreateCalibration(grpc::ServerContext* /*context*/,
                                                   const v1::CreateCalibrationRequest* request,
                                                   v1::Calibration* response) {
  return GuardedCall("CreateCalibration", [&]() -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(CalibrationOptions options, wire::FromProto(request->options()));
    RIGCAL_ASSIGN_OR_RETURN(
        const Calibration calibration,
        runner_.CreateCalibration({request->session_ids().begin(), request->session_ids().end()},
                                  std::move(options)));
    *response = wire::ToProto(calibration);
    return absl::OkStatus();
  });
}

grpc::Status CalibrationService::GetCalibration(grpc::ServerContext* /*context*/,
                                                const v1::GetCalibrationRequest* request,
                                                v1::Calibration* response) {
  return GuardedCall("GetCalibration", [&]() -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(const Calibration calibration, runner_.GetCalibration(request->id()));
    *response = wire::ToProto(calibration);
    return absl::OkStatus();
  });
}

grpc::Status CalibrationService::ListCalibrations(grpc::ServerContext* /*context*/,
                                                  const v1::ListCalibrationsRequest* request,
                                                  v1::ListCalibrationsResponse* response) {
  return GuardedCall("ListCalibrations", [&]() -> absl::Status {
    const std::string& token = request->page_token();
    const int page_size = PageSize(request->page_size());
    // One more than asked for, to know whether there is another page.
    const auto calibrations = runner_.ListCalibrations(request->rig(), page_size + 1, token);
    if (!calibrations.ok()) return PageError(calibrations.status(), token);
    size_t bytes = 0;
    for (const Calibration& calibration : *calibrations) {
      if (response->calibrations_size() == page_size || bytes > kMaxPageBytes) {
        response->set_next_page_token(response->calibrations().rbegin()->id());
        break;
      }
      v1::Calibration proto = wire::ToProto(calibration);
      proto.clear_cameras();
      proto.clear_refused();
      bytes += proto.ByteSizeLong();
      *response->add_calibrations() = std::move(proto);
    }
    return absl::OkStatus();
  });
}

grpc::Status CalibrationService::CancelCalibration(grpc::ServerContext* /*context*/,
                                                   const v1::CancelCalibrationRequest* request,
                                                   v1::Calibration* response) {
  return GuardedCall("CancelCalibration", [&]() -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(const Calibration calibration,
                            runner_.CancelCalibration(request->id()));
    *response = wire::ToProto(calibration);
    return absl::OkStatus();
  });
}

grpc::Status CalibrationService::WatchCalibration(grpc::ServerContext* context,
                                                  const v1::WatchCalibrationRequest* request,
                                                  grpc::ServerWriter<v1::Calibration>* writer) {
  return GuardedCall("WatchCalibration", [&]() -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(const auto watch, runner_.WatchCalibration(request->id()));
    return RunWatch(*context, watch.get(), [&]() -> absl::StatusOr<bool> {
      RIGCAL_ASSIGN_OR_RETURN(const Calibration calibration, runner_.GetCalibration(request->id()));
      if (!writer->Write(wire::ToProto(calibration))) {
        return absl::CancelledError("the client has gone");
      }
      return calibration.state == CalibrationState::kSucceeded ||
             calibration.state == CalibrationState::kFailed;
    });
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
