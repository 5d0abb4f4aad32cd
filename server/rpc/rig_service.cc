// SPDX-License-Identifier: Apache-2.0
#include <string>

#include "common/status/status_macros.h"
#include "common/wire/request_traits.h"
#include "common/wire/rig_wire.h"
#include "rigcal/v1/rig_service.grpc.pb.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/services.h"
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
  RigService(Store* store, CallSecurity* security) : book_(store), security_(*security) {}

  grpc::Status ListRigs(grpc::ServerContext*, const v1::ListRigsRequest*,
                        v1::ListRigsResponse* response) override {
    return GuardedCall("ListRigs", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(const std::vector<RigState> rigs, book_.ListRigs());
      for (const RigState& rig : rigs) Describe(rig, response->add_rigs());
      return absl::OkStatus();
    });
  }

  grpc::Status GetRig(grpc::ServerContext*, const v1::GetRigRequest* request,
                      v1::GetRigResponse* response) override {
    return GuardedCall("GetRig", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(const RigState rig, book_.GetRig(request->name()));
      Describe(rig, response->mutable_rig());
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
  std::string OperatorOf(const grpc::ServerContext& context) {
    return security_.CallerOf(context).OperatorName();
  }

  RigBook book_;
  CallSecurity& security_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeRigService(Store* store, CallSecurity* security) {
  return std::make_unique<RigService>(store, security);
}

}  // namespace rigcal::server
