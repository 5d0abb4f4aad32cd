// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <utility>

#include "common/status/status_macros.h"
#include "common/wire/preview_wire.h"
#include "common/wire/time_wire.h"
#include "rigcal/v1/camera_service.grpc.pb.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/services.h"

namespace rigcal::server {
namespace {

class CameraService final : public v1::CameraService::Service {
 public:
  explicit CameraService(PreviewBroker* previews) : previews_(*previews) {}

  grpc::Status GetPreview(grpc::ServerContext* context, const v1::GetPreviewRequest* request,
                          v1::GetPreviewResponse* response) override {
    return GuardedCall("GetPreview", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(const uint32_t max_wait_ms,
                              wire::MillisecondsOf(request->max_wait(), "max_wait"));
      RIGCAL_ASSIGN_OR_RETURN(
          PreviewBroker::CameraPreview camera,
          previews_.Get(request->rig(), request->camera(), std::chrono::milliseconds(max_wait_ms),
                        [context] { return context->IsCancelled(); }));
      response->set_agent_id(camera.agent_id);
      response->set_rig(camera.rig);
      *response->mutable_info() = wire::ToProto(camera.preview.info, camera.preview.jpeg.size());
      response->set_jpeg(std::move(camera.preview.jpeg));
      return absl::OkStatus();
    });
  }

 private:
  PreviewBroker& previews_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeCameraService(PreviewBroker* previews) {
  return std::make_unique<CameraService>(previews);
}

}  // namespace rigcal::server
