// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rigcal/v1/camera_service.grpc.pb.h"
#include "server/session/preview_broker.h"

namespace rigcal::server {

// rigcal.v1.CameraService.
class CameraService final : public v1::CameraService::Service {
 public:
  explicit CameraService(PreviewBroker* previews) : previews_(*previews) {}

  grpc::Status GetPreview(grpc::ServerContext* context, const v1::GetPreviewRequest* request,
                          v1::GetPreviewResponse* response) override;

 private:
  PreviewBroker& previews_;
};

}  // namespace rigcal::server
