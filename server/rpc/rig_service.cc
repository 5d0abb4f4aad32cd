// SPDX-License-Identifier: Apache-2.0
#include <string>

#include "common/status/status_macros.h"
#include "common/wire/request_traits.h"
#include "common/wire/rig_wire.h"
#include "rigcal/v1/rig_service.grpc.pb.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/services.h"
#include "server/session/monitor_settings.h"
#include "server/session/rig_book.h"

namespace rigcal::server {
namespace {

void Describe(const RigState& state, v1::Rig* rig) {
  rig->set_name(state.summary.name);
  rig->set_calibration_count(state.summary.calibration_count);
  if (state.activation.calibration_id.empty()) return;
  rig->set_active_calibration_id(state.activation.calibration_id);
  rig->set_active_version(state.activation.version);
  *rig->mutable_activation() = wire::ToProto(state.activation);
  rig->mutable_cameras()->Assign(state.cameras.begin(), state.cameras.end());
}

class RigService final : public v1::RigService::Service {
 public:
  RigService(const RpcServerParts& parts, CallSecurity* security)
      : book_(parts.store), monitors_(parts.monitors), security_(*security) {}

  grpc::Status ListRigs(grpc::ServerContext*, const v1::ListRigsRequest*,
                        v1::ListRigsResponse* response) override {
    return GuardedCall("ListRigs", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(const std::vector<RigState> rigs, book_.ListRigs());
      for (const RigState& rig : rigs) DescribeRig(rig, response->add_rigs());
      return absl::OkStatus();
    });
  }

  grpc::Status GetRig(grpc::ServerContext*, const v1::GetRigRequest* request,
                      v1::GetRigResponse* response) override {
    return GuardedCall("GetRig", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(const RigState rig, book_.GetRig(request->name()));
      DescribeRig(rig, response->mutable_rig());
      return absl::OkStatus();
    });
  }

  grpc::Status ActivateCalibration(grpc::ServerContext* context,
                                   const v1::ActivateCalibrationRequest* request,
                                   v1::ActivateCalibrationResponse* response) override {
    return GuardedCall("ActivateCalibration", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(const Activation activation,
                              book_.Activate(request->id(), {OperatorOf(*context),
                                                             request->reason(), request->force()}));
      *response->mutable_activation() = wire::ToProto(activation);
      return absl::OkStatus();
    });
  }

  grpc::Status RollbackRig(grpc::ServerContext* context, const v1::RollbackRigRequest* request,
                           v1::RollbackRigResponse* response) override {
    return GuardedCall("RollbackRig", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(
          const Activation activation,
          book_.Rollback(request->name(),
                         {OperatorOf(*context), request->reason(), request->force()}));
      *response->mutable_activation() = wire::ToProto(activation);
      return absl::OkStatus();
    });
  }

  grpc::Status SetRigMonitor(grpc::ServerContext*, const v1::SetRigMonitorRequest* request,
                             v1::SetRigMonitorResponse* response) override {
    return GuardedCall("SetRigMonitor", [&]() -> absl::Status {
      if (monitors_ == nullptr) return absl::UnimplementedError("this server monitors no rigs");
      if (!v1::MonitorMode_IsValid(request->mode()) ||
          request->mode() == v1::MONITOR_MODE_UNSPECIFIED) {
        return absl::InvalidArgumentError(
            "mode: must be MONITOR_MODE_OFF, MONITOR_MODE_WATCH or MONITOR_MODE_REPAIR");
      }
      RIGCAL_ASSIGN_OR_RETURN(const RigState rig, book_.GetRig(request->name()));
      RIGCAL_RETURN_IF_ERROR(
          monitors_->Set(rig.summary.name, static_cast<MonitorMode>(request->mode())));
      DescribeRig(rig, response->mutable_rig());
      return absl::OkStatus();
    });
  }

  grpc::Status ListActivations(grpc::ServerContext*, const v1::ListActivationsRequest* request,
                               v1::ListActivationsResponse* response) override {
    return GuardedCall("ListActivations", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(const std::vector<Activation> history, book_.History(request->rig()));
      for (const Activation& activation : history) {
        *response->add_activations() = wire::ToProto(activation);
      }
      return absl::OkStatus();
    });
  }

 private:
  void DescribeRig(const RigState& state, v1::Rig* rig) const {
    Describe(state, rig);
    const MonitorMode mode =
        monitors_ == nullptr ? MonitorMode::kOff : monitors_->Of(state.summary.name);
    rig->set_monitor(static_cast<v1::MonitorMode>(mode));
  }
  std::string OperatorOf(const grpc::ServerContext& context) {
    return security_.CallerOf(context).OperatorName();
  }

  RigBook book_;
  MonitorSettings* const monitors_;
  CallSecurity& security_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeRigService(const RpcServerParts& parts, CallSecurity* security) {
  return std::make_unique<RigService>(parts, security);
}

}  // namespace rigcal::server
