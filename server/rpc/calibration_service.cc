// SPDX-License-Identifier: Apache-2.0
#include <functional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/export/calibration_export.h"
#include "common/export/covariance_json.h"
#include "common/export/undistorted.h"
#include "common/status/status_macros.h"
#include "common/wire/calibration_result_wire.h"
#include "common/wire/calibration_wire.h"
#include "common/wire/camera_wire.h"
#include "common/wire/frame_wire.h"
#include "common/wire/request_traits.h"
#include "rigcal/v1/calibration_service.grpc.pb.h"
#include "server/rpc/answer_limits.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/correlated_call.h"
#include "server/rpc/list_arguments.h"
#include "server/rpc/services.h"
#include "server/solve/evaluate/rig_difference.h"
#include "server/solve/evaluate/triangulation_accuracy.h"

namespace rigcal::server {
namespace {

constexpr FilterField kCalibrationFilterFields[] = {
    {"rig"}, {"state"}, {.name = "session_ids", .repeated = true}};
// Clients accept 4 MiB.
constexpr size_t kMaxExportBytes = size_t{3} << 20;
constexpr ListFields kCalibrationFields = {.filter = kCalibrationFilterFields};

absl::Status Describe(const absl::StatusOr<Calibration>& calibration, v1::Calibration* response) {
  if (calibration.ok()) {
    *response = wire::ToProto(*calibration);
    FitAnswer(response);
  }
  return calibration.status();
}

void SetPoint(const PointAccuracy& point, v1::PointAccuracy* proto) {
  *proto->mutable_point_m() = wire::ToProto(point.point_m);
  proto->set_camera_count(point.camera_count);
  if (point.camera_count < 2) return;
  *proto->mutable_noise_sigma_m() = wire::ToProto(point.noise_sigma_m);
  *proto->mutable_shape_sigma_m() = wire::ToProto(point.shape_sigma_m);
  *proto->mutable_sigma_m() = wire::ToProto(point.sigma_m);
  proto->set_shape_total_m(point.shape_sigma_m.norm());
  proto->set_total_m(point.sigma_m.norm());
  proto->set_calibration_total_m(point.calibration_sigma_m);
}

void SetSummary(const AccuracySummary& summary, v1::AccuracySummary* proto) {
  proto->set_count(summary.count);
  proto->set_median_m(summary.median_m);
  proto->set_p95_m(summary.p95_m);
  proto->set_worst_m(summary.worst_m);
  if (summary.count > 0) *proto->mutable_worst_point_m() = wire::ToProto(summary.worst_point_m);
}

v1::CompareCalibrationsResponse DifferenceMessage(const RigDifference& difference) {
  v1::CompareCalibrationsResponse message;
  message.mutable_frame_cameras()->Assign(difference.frame_cameras.begin(),
                                          difference.frame_cameras.end());
  message.mutable_only_in_a()->Assign(difference.only_in_a.begin(), difference.only_in_a.end());
  message.mutable_only_in_b()->Assign(difference.only_in_b.begin(), difference.only_in_b.end());
  message.set_scale_difference(difference.scale_difference);
  message.set_problem(difference.problem);
  *message.mutable_centre_m() = wire::ToProto(difference.centre_m);
  for (const CameraDifference& camera : difference.cameras) {
    v1::CameraDifference* const proto = message.add_cameras();
    proto->set_camera(camera.camera);
    proto->set_verdict(static_cast<v1::CameraDifference::Verdict>(camera.verdict));
    proto->set_translation_m(camera.translation_m);
    proto->set_translation_sigma_m(camera.translation_sigma_m);
    proto->set_rotation_rad(camera.rotation_rad);
    proto->set_rotation_sigma_rad(camera.rotation_sigma_rad);
    proto->set_centre_px(camera.centre_px);
    proto->set_centre_sigma_px(camera.centre_sigma_px);
    proto->set_sigmas(camera.sigmas);
    proto->set_time_offset_s(camera.time_offset_s);
    proto->set_time_offset_sigma_s(camera.time_offset_sigma_s);
  }
  return message;
}

absl::Status NoResult(const Calibration& calibration) {
  return absl::FailedPreconditionError(absl::StrCat(
      "calibration ", calibration.id, " has no result", ": ", WhyNoResult(calibration.state)));
}

absl::StatusOr<v1::GetAccuracyResponse> AccuracyOf(const Calibration& calibration,
                                                   const v1::GetAccuracyRequest& request) {
  if (calibration.state != CalibrationState::kSucceeded || !calibration.result) {
    return NoResult(calibration);
  }
  AccuracyOptions options;
  options.grid_step_m = request.grid_step_m();
  if (request.sigma_px() != 0) options.sigma_px = request.sigma_px();
  for (const v1::Vector3& point : request.points_m()) {
    options.points_m.push_back(wire::FromProto(point));
  }
  RIGCAL_ASSIGN_OR_RETURN(const Accuracy accuracy, ComputeAccuracy(*calibration.result, options));
  v1::GetAccuracyResponse response;
  response.set_id(calibration.id);
  response.set_sigma_px(options.sigma_px);
  response.set_grid_step_m(accuracy.grid_step_m);
  response.set_scale_sigma_rel(accuracy.scale_sigma_rel);
  for (const PointAccuracy& point : accuracy.points) SetPoint(point, response.add_points());
  for (const PointAccuracy& point : accuracy.grid) SetPoint(point, response.add_grid());
  SetSummary(accuracy.shape, response.mutable_shape());
  SetSummary(accuracy.with_scale, response.mutable_with_scale());
  response.set_calibration_p95_m(accuracy.calibration_p95_m);
  response.set_calibration_rms_m(accuracy.calibration_rms_m);
  response.set_frame_rms_m(accuracy.frame_rms_m);
  response.set_noise_rms_m(accuracy.noise_rms_m);
  return response;
}

absl::Status FillResiduals(const Calibration& calibration, const std::string& camera,
                           v1::GetResidualsResponse* response) {
  if (calibration.state != CalibrationState::kSucceeded || !calibration.result) {
    return NoResult(calibration);
  }
  response->set_id(calibration.id);
  bool known = camera.empty();
  for (const CalibratedCamera& each : calibration.result->cameras) known |= each.camera == camera;
  if (!known) {
    return absl::NotFoundError(
        absl::StrCat("calibration ", calibration.id, " has no camera '", camera, "'"));
  }
  for (const CameraResiduals& each : calibration.result->residuals) {
    if (camera.empty() || each.camera == camera) *response->add_cameras() = wire::ToProto(each);
  }
  if (!response->cameras().empty()) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("calibration ", calibration.id,
                   " was made before residuals were kept; calibrate its sessions again"));
}

// Of an ExportCalibrationRequest or a ListExportsRequest.
template <typename Request>
absl::StatusOr<ExportOptions> ReadExportOptions(const Request& request) {
  ExportOptions options;
  if (!(request.max_error_px() >= 0 && request.max_error_px() <= 100)) {
    return absl::InvalidArgumentError(
        absl::StrCat("max_error_px: ", request.max_error_px(), " is not between 0 and 100"));
  }
  if (request.max_error_px() > 0) options.max_error_px = request.max_error_px();
  if (request.up_axis().empty()) return options;
  const absl::StatusOr<UpAxis> up = ParseUpAxis(request.up_axis());
  if (!up.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("up_axis: ", std::string(up.status().message())));
  }
  options.up = *up;
  return options;
}

// Of the whole calibration the covariance is a part, where it fits into the answer.
void AddCovariance(const Calibration& calibration, const std::string& format_name,
                   std::string* content) {
  if (format_name != "json" || !calibration.result) return;
  std::string with = WithCameraCovariance(*content, calibration.result->camera_covariance);
  if (with.size() <= kMaxExportBytes) *content = std::move(with);
}

absl::Status FillExport(const v1::Calibration& calibration,
                        const v1::ExportCalibrationRequest& request,
                        v1::ExportCalibrationResponse* response) {
  RIGCAL_ASSIGN_OR_RETURN(const CalibrationExportFormat* format,
                          FindCalibrationExportFormat(request.format()));
  RIGCAL_ASSIGN_OR_RETURN(const ExportOptions options, ReadExportOptions(request));
  RIGCAL_ASSIGN_OR_RETURN(
      ExportDownload download,
      MakeDownload(*format, calibration, request.undistorted() ? "-undistorted" : "", options));
  if (download.content.size() > kMaxExportBytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat("calibration ", calibration.id(), " has ", download.content.size(),
                     " bytes in this format, more than fit into one answer; write it with rigcal "
                     "calibration export"));
  }
  response->set_file_name(download.file_name);
  response->set_content_type(download.content_type);
  response->set_content(std::move(download.content));
  return absl::OkStatus();
}

class CalibrationService final : public v1::CalibrationService::WithCallbackMethod_WatchCalibration<
                                     v1::CalibrationService::Service> {
 public:
  CalibrationService(CalibrationRunner* runner, WatchHub* watches, CallSecurity* security)
      : runner_(*runner), watches_(*watches), security_(*security) {}

  grpc::Status CreateCalibration(grpc::ServerContext* context,
                                 const v1::CreateCalibrationRequest* request,
                                 v1::CreateCalibrationResponse* response) override {
    return CorrelatedCall("CreateCalibration", context, {}, [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(CalibrationOptions options, wire::FromProto(request->options()));
      return Describe(
          runner_.CreateCalibration(
              {request->session_ids().begin(), request->session_ids().end()}, std::move(options),
              {security_.CallerOf(*context).OperatorName(), request->reason(), request->notes()}),
          response->mutable_calibration());
    });
  }

  grpc::Status CompareCalibrations(grpc::ServerContext*,
                                   const v1::CompareCalibrationsRequest* request,
                                   v1::CompareCalibrationsResponse* response) override {
    return GuardedCall("CompareCalibrations", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(const Calibration a, runner_.GetCalibration(request->id_a()));
      RIGCAL_ASSIGN_OR_RETURN(const Calibration b, runner_.GetCalibration(request->id_b()));
      if (!a.result) return NoResult(a);
      if (!b.result) return NoResult(b);
      RIGCAL_ASSIGN_OR_RETURN(const RigDifference difference, CompareRigs(*a.result, *b.result));
      *response = DifferenceMessage(difference);
      response->set_id_a(a.id);
      response->set_id_b(b.id);
      return absl::OkStatus();
    });
  }

  grpc::Status ExplainCalibration(grpc::ServerContext*,
                                  const v1::ExplainCalibrationRequest* request,
                                  v1::ExplainCalibrationResponse* response) override {
    return GuardedCall("ExplainCalibration", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(const Calibration calibration, runner_.GetCalibration(request->id()));
      if (!calibration.result) return NoResult(calibration);
      if (!calibration.result->information) {
        return absl::FailedPreconditionError(absl::StrCat(
            "calibration ", calibration.id,
            " keeps no figures of its information: it was made by an older version, or its data "
            "leave something undetermined; calibrate its sessions again"));
      }
      response->set_id(calibration.id);
      *response->mutable_information() = wire::ToProto(*calibration.result->information);
      return absl::OkStatus();
    });
  }

  grpc::Status GetCalibration(grpc::ServerContext*, const v1::GetCalibrationRequest* request,
                              v1::GetCalibrationResponse* response) override {
    return GuardedCall("GetCalibration", [&] {
      return Describe(runner_.GetCalibration(request->id()), response->mutable_calibration());
    });
  }

  grpc::Status ListCalibrations(grpc::ServerContext*, const v1::ListCalibrationsRequest* request,
                                v1::ListCalibrationsResponse* response) override {
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
          RIGCAL_ASSIGN_OR_RETURN(const auto state, ParseState<v1::Calibration::State>(term.value));
          filter.state = static_cast<CalibrationState>(state);
        }
      }
      RIGCAL_ASSIGN_OR_RETURN(const auto calibrations,
                              runner_.ListCalibrations(filter, list.Page()));
      const auto describe = [](const Calibration& calibration, v1::Calibration* proto) {
        *proto = wire::ToProto(calibration);
        // One that has just ended is listed from memory, with all that it has.
        proto->clear_cameras();
        proto->clear_refused();
        FitAnswer(proto);
        return absl::OkStatus();
      };
      return FillPage(list, calibrations, describe, response->mutable_calibrations(),
                      response->mutable_next_page_token());
    });
  }

  grpc::Status CancelCalibration(grpc::ServerContext* context,
                                 const v1::CancelCalibrationRequest* request,
                                 v1::CancelCalibrationResponse* response) override {
    return CorrelatedCall("CancelCalibration", context, {.calibration = request->id()}, [&] {
      return Describe(runner_.CancelCalibration(request->id()), response->mutable_calibration());
    });
  }

  grpc::Status DeleteCalibration(grpc::ServerContext* context,
                                 const v1::DeleteCalibrationRequest* request,
                                 v1::DeleteCalibrationResponse*) override {
    return CorrelatedCall("DeleteCalibration", context, {.calibration = request->id()},
                          [&] { return runner_.DeleteCalibration(request->id()); });
  }

  grpc::ServerWriteReactor<v1::WatchCalibrationResponse>* WatchCalibration(
      grpc::CallbackServerContext*, const v1::WatchCalibrationRequest* request) override {
    if (const absl::Status fault = wire::FaultOf(*request); !fault.ok()) {
      return new RefusedWatch<v1::WatchCalibrationResponse>(fault);
    }
    const std::string id = request->id();
    return watches_.Open<v1::WatchCalibrationResponse>(
        [&](std::function<void()> wake) { return runner_.WatchCalibration(id, std::move(wake)); },
        [this, id](v1::WatchCalibrationResponse* response) -> absl::StatusOr<bool> {
          RIGCAL_ASSIGN_OR_RETURN(const Calibration calibration, runner_.GetCalibration(id));
          *response->mutable_calibration() = wire::ToProto(calibration);
          FitAnswer(response->mutable_calibration());
          return HasEnded(calibration.state);
        });
  }

  grpc::Status GetAccuracy(grpc::ServerContext*, const v1::GetAccuracyRequest* request,
                           v1::GetAccuracyResponse* response) override {
    return GuardedCall("GetAccuracy", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(const Calibration calibration, runner_.GetCalibration(request->id()));
      RIGCAL_ASSIGN_OR_RETURN(*response, AccuracyOf(calibration, *request));
      return absl::OkStatus();
    });
  }

  grpc::Status GetResiduals(grpc::ServerContext*, const v1::GetResidualsRequest* request,
                            v1::GetResidualsResponse* response) override {
    return GuardedCall("GetResiduals", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(const Calibration calibration, runner_.GetCalibration(request->id()));
      return FillResiduals(calibration, request->camera(), response);
    });
  }

  grpc::Status ListExports(grpc::ServerContext*, const v1::ListExportsRequest* request,
                           v1::ListExportsResponse* response) override {
    return GuardedCall("ListExports", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(const Calibration calibration, runner_.GetCalibration(request->id()));
      RIGCAL_ASSIGN_OR_RETURN(const ExportOptions options, ReadExportOptions(*request));
      v1::Calibration described = wire::ToProto(calibration);
      if (request->undistorted()) described = Undistorted(std::move(described));
      for (const CalibrationExportFormat& format : CalibrationExportFormats()) {
        v1::ExportFormat* const proto = response->add_formats();
        proto->set_name(format.name);
        proto->set_description(format.help);
        proto->set_problem(std::string(format.make(described, options).status().message()));
      }
      return absl::OkStatus();
    });
  }

  grpc::Status ExportCalibration(grpc::ServerContext*, const v1::ExportCalibrationRequest* request,
                                 v1::ExportCalibrationResponse* response) override {
    return GuardedCall("ExportCalibration", [&]() -> absl::Status {
      const absl::StatusOr<Calibration> stored = runner_.GetCalibration(request->id());
      v1::Calibration calibration;
      RIGCAL_RETURN_IF_ERROR(Describe(stored, &calibration));
      if (request->undistorted()) calibration = Undistorted(std::move(calibration));
      RIGCAL_RETURN_IF_ERROR(FillExport(calibration, *request, response));
      // The covariance is that of the lenses, too.
      if (!request->undistorted()) {
        AddCovariance(*stored, request->format(), response->mutable_content());
      }
      return absl::OkStatus();
    });
  }

 private:
  CalibrationRunner& runner_;
  WatchHub& watches_;
  CallSecurity& security_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeCalibrationService(const RpcServerParts& parts,
                                                      WatchHub* watches, CallSecurity* security) {
  return std::make_unique<CalibrationService>(parts.runner, watches, security);
}

}  // namespace rigcal::server
