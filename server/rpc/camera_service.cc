// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/detector_wire.h"
#include "common/wire/preview_wire.h"
#include "common/wire/time_wire.h"
#include "rigcal/v1/camera_service.grpc.pb.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/services.h"

namespace rigcal::server {
namespace {

DetectorRequest RequestOf(DetectorCommand command, uint32_t frame_count = 0) {
  DetectorRequest request;
  request.command = command;
  request.frame_count = frame_count;
  return request;
}

class CameraService final : public v1::CameraService::Service {
 public:
  CameraService(const RpcServerParts& parts, PreviewBroker* previews, DetectorBroker* detectors,
                CameraChoices* choices)
      : directory_(*parts.directory),
        registry_(parts.registry),
        previews_(*previews),
        detectors_(*detectors),
        choices_(*choices) {}

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

  grpc::Status UseCamera(grpc::ServerContext* context, const v1::UseCameraRequest* request,
                         v1::UseCameraResponse* response) override {
    return GuardedCall("UseCamera", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(const CameraChoices::Chosen chosen,
                              choices_.Use(request->agent_id(),
                                           {.device = request->device(),
                                            .camera = request->camera(),
                                            .calibration_yaml = request->calibration_yaml()},
                                           [context] { return context->IsCancelled(); }));
      response->set_agent_id(chosen.agent_id);
      response->set_rig(chosen.rig);
      response->set_camera(request->camera());
      return absl::OkStatus();
    });
  }

  grpc::Status DropCamera(grpc::ServerContext* context, const v1::DropCameraRequest* request,
                          v1::DropCameraResponse* response) override {
    return GuardedCall("DropCamera", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(const CameraChoices::Chosen chosen,
                              choices_.Drop(request->rig(), request->camera(),
                                            [context] { return context->IsCancelled(); }));
      response->set_agent_id(chosen.agent_id);
      response->set_rig(chosen.rig);
      response->set_camera(request->camera());
      return absl::OkStatus();
    });
  }

  grpc::Status GetDetector(grpc::ServerContext* context, const v1::GetDetectorRequest* request,
                           v1::GetDetectorResponse* response) override {
    return AskDetector("GetDetector", context, *request, RequestOf(DetectorCommand::kGet),
                       response);
  }
  grpc::Status LearnMask(grpc::ServerContext* context, const v1::LearnMaskRequest* request,
                         v1::LearnMaskResponse* response) override {
    return AskDetector("LearnMask", context, *request,
                       RequestOf(DetectorCommand::kLearnMask, request->frame_count()), response);
  }
  grpc::Status ClearMask(grpc::ServerContext* context, const v1::ClearMaskRequest* request,
                         v1::ClearMaskResponse* response) override {
    return AskDetector("ClearMask", context, *request, RequestOf(DetectorCommand::kClearMask),
                       response);
  }
  grpc::Status TuneDetector(grpc::ServerContext* context, const v1::TuneDetectorRequest* request,
                            v1::TuneDetectorResponse* response) override {
    return AskDetector("TuneDetector", context, *request,
                       RequestOf(DetectorCommand::kTune, request->frame_count()), response);
  }
  grpc::Status SetDetectorColour(grpc::ServerContext* context,
                                 const v1::SetDetectorColourRequest* request,
                                 v1::SetDetectorColourResponse* response) override {
    DetectorRequest detector = RequestOf(DetectorCommand::kSetColour);
    if (request->has_colour()) {
      const absl::StatusOr<ColourRange> colour = wire::FromProto(request->colour());
      if (!colour.ok()) return wire::ToGrpc(colour.status());
      detector.colour = *colour;
    }
    return AskDetector("SetDetectorColour", context, *request, std::move(detector), response);
  }

 private:
  // `request` has a rig and a camera, `response` says whose detector it has.
  template <typename Request, typename Response>
  grpc::Status AskDetector(const char* rpc, grpc::ServerContext* context, const Request& request,
                           DetectorRequest detector, Response* response) {
    return GuardedCall(rpc, [&]() -> absl::Status {
      detector.camera = request.camera();
      RIGCAL_ASSIGN_OR_RETURN(const DetectorBroker::CameraDetector camera,
                              detectors_.Ask(request.rig(), std::move(detector),
                                             [context] { return context->IsCancelled(); }));
      response->set_agent_id(camera.agent_id);
      response->set_rig(camera.rig);
      *response->mutable_detector() = wire::ToProto(camera.state);
      return absl::OkStatus();
    });
  }

  const AgentDirectory& directory_;
  AgentRegistry* const registry_;
  PreviewBroker& previews_;
  DetectorBroker& detectors_;
  CameraChoices& choices_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeCameraService(const RpcServerParts& parts,
                                                 PreviewBroker* previews, DetectorBroker* detectors,
                                                 CameraChoices* choices) {
  return std::make_unique<CameraService>(parts, previews, detectors, choices);
}

}  // namespace rigcal::server
