// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rigcal/v1/calibration_service.grpc.pb.h"
#include "server/rpc/watch_hub.h"
#include "server/session/calibration_runner.h"

namespace rigcal::server {

// rigcal.v1.CalibrationService.
class CalibrationService final : public v1::CalibrationService::WithCallbackMethod_WatchCalibration<
                                     v1::CalibrationService::Service> {
 public:
  CalibrationService(CalibrationRunner* runner, WatchHub* watches)
      : runner_(*runner), watches_(*watches) {}

  grpc::Status CreateCalibration(grpc::ServerContext* context,
                                 const v1::CreateCalibrationRequest* request,
                                 v1::CreateCalibrationResponse* response) override;
  grpc::Status GetCalibration(grpc::ServerContext* context,
                              const v1::GetCalibrationRequest* request,
                              v1::GetCalibrationResponse* response) override;
  grpc::Status ListCalibrations(grpc::ServerContext* context,
                                const v1::ListCalibrationsRequest* request,
                                v1::ListCalibrationsResponse* response) override;
  grpc::Status CancelCalibration(grpc::ServerContext* context,
                                 const v1::CancelCalibrationRequest* request,
                                 v1::CancelCalibrationResponse* response) override;
  grpc::Status DeleteCalibration(grpc::ServerContext* context,
                                 const v1::DeleteCalibrationRequest* request,
                                 v1::DeleteCalibrationResponse* response) override;
  grpc::ServerWriteReactor<v1::WatchCalibrationResponse>* WatchCalibration(
      grpc::CallbackServerContext* context, const v1::WatchCalibrationRequest* request) override;
  grpc::Status GetAccuracy(grpc::ServerContext* context, const v1::GetAccuracyRequest* request,
                           v1::GetAccuracyResponse* response) override;

 private:
  CalibrationRunner& runner_;
  WatchHub& watches_;
};

}  // namespace rigcal::server
