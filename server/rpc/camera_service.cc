// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
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
  CameraService(const RpcServerParts& parts, PreviewBroker* previews)
      : directory_(*parts.directory), registry_(parts.registry), previews_(*previews) {}

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

  grpc::Status MoveCamera(grpc::ServerContext*, const v1::MoveCameraRequest* request,
                          v1::MoveCameraResponse* response) override {
    return GuardedCall("MoveCamera", [&]() -> absl::Status {
      if (registry_ == nullptr) {
        return absl::FailedPreconditionError("on this server cameras belong to nobody");
      }
      const std::string rig = request->rig().empty() ? "rig" : request->rig();
      for (const AgentDirectory::ConnectedCamera& camera : directory_.ConnectedCameras(rig)) {
        if (camera.camera.description.camera != request->camera() ||
            camera.agent_id == request->agent_id()) {
          continue;
        }
        return absl::FailedPreconditionError(
            absl::StrCat("camera '", rig, "/", request->camera(), "' cannot be moved: agent '",
                         camera.agent_id, "' is connected with it; stop that agent first"));
      }
      RIGCAL_ASSIGN_OR_RETURN(std::string before,
                              registry_->Move(rig, request->camera(), request->agent_id()));
      response->set_rig(rig);
      response->set_camera(request->camera());
      response->set_agent_id(request->agent_id());
      response->set_previous_agent_id(std::move(before));
      return absl::OkStatus();
    });
  }

 private:
  const AgentDirectory& directory_;
  AgentRegistry* const registry_;
  PreviewBroker& previews_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeCameraService(const RpcServerParts& parts,
                                                 PreviewBroker* previews) {
  return std::make_unique<CameraService>(parts, previews);
}

}  // namespace rigcal::server
