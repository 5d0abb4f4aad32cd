// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rigcal/v1/calibration.grpc.pb.h"
#include "server/session/calibration_runner.h"

namespace rigcal::server {

// rigcal.v1.CalibrationService.
class CalibrationService final : public v1::CalibrationService::Service {
 public:
  explicit CalibrationService(CalibrationRunner* runner) : runner_(*runner) {}

  grpc::Status CreateCalibration(grpc::ServerContext* context,
                                 const v1::CreateCalibrationRequest* request,
                                 v1::Calibration* response) override;
  grpc::Status GetCalibration(grpc::ServerContext* context,
                              const v1::GetCalibrationRequest* request,
                              v1::Calibration* response) override;
  grpc::Status ListCalibrations(grpc::ServerContext* context,
                                const v1::ListCalibrationsRequest* request,
                                v1::ListCalibrationsResponse* response) override;
  grpc::Status CancelCalibration(grpc::ServerContext* context,
                                 const v1::CancelCalibrationRequest* request,
                                 v1::Calibration* response) override;
  grpc::Status WatchCalibration(grpc::ServerContext* context,
                                const v1::WatchCalibrationRequest* request,
                                grpc::ServerWriter<v1::Calibration>* writer) override;
  grpc::Status GetAccuracy(grpc::ServerContext* context, const v1::GetAccuracyRequest* request,
                           v1::GetAccuracyResponse* response) override;

 private:
  CalibrationRunner& runner_;
};

}  // namespace rigcal::server
