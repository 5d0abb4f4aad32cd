// SPDX-License-Identifier: Apache-2.0
#include <grpcpp/support/server_callback.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/triangulate/row_stream.h"
#include "common/wire/camera_wire.h"
#include "common/wire/grpc_status.h"
#include "common/wire/request_traits.h"
#include "rigcal/v1/triangulation_service.grpc.pb.h"
#include "server/rpc/services.h"
#include "server/session/rig_book.h"
#include "server/session/task_queue.h"

namespace rigcal::server {
namespace {

constexpr int kMaxTriangulations = 16;
constexpr size_t kPointsPerMessage = 8192;

using TriangulationReactor =
    grpc::ServerBidiReactor<v1::TriangulateRequest, v1::TriangulateResponse>;

// What all streams share.
struct TriangulationEnvironment {
  Store* store;
  std::atomic<int> open_streams{0};
  // Where points are made: one message of one stream at a time. A stream that its client does not
  // read has no task.
  TaskQueue tasks{"triangulation"};
};

absl::StatusOr<Calibration> CalibrationToUse(const v1::TriangulateStart& start, Store* store) {
  std::string id = start.calibration_id();
  if (id.empty()) {
    const std::string rig = start.rig().empty() ? "rig" : start.rig();
    RIGCAL_ASSIGN_OR_RETURN(const RigState state, RigBook(store).GetRig(rig));
    id = state.activation.calibration_id;
    if (id.empty()) {
      return absl::FailedPreconditionError(
          absl::StrCat("rig '", rig, "' has no active calibration; name a calibration"));
    }
  }
  RIGCAL_ASSIGN_OR_RETURN(Calibration calibration, store->GetCalibration(id));
  if (calibration.state != CalibrationState::kSucceeded || !calibration.result) {
    return absl::FailedPreconditionError(absl::StrCat(
        "calibration ", calibration.id, " has no result", ": ", WhyNoResult(calibration.state)));
  }
  return calibration;
}

RowStreamOptions StreamOptionsOf(const v1::TriangulateStart& start,
                                 const CalibrationResult& calibration) {
  RowStreamOptions options;
  options.cameras.assign(start.cameras().begin(), start.cameras().end());
  options.triangulation.sigma_px = start.sigma_px();
  if (start.max_sigmas() != 0) options.triangulation.max_sigmas = start.max_sigmas();
  options.triangulation.diameter_m =
      start.has_diameter_m() ? start.diameter_m() : calibration.target.given.diameter_m;
  if (start.block_s() != 0) options.block_s = start.block_s();
  if (start.max_delay_s() != 0) options.max_delay_s = start.max_delay_s();
  return options;
}

absl::StatusOr<std::vector<Observation>> RowsOf(const v1::TriangulateRows& rows) {
  const auto count = static_cast<size_t>(rows.time_ns_size());
  const size_t markers = rows.marker_count();
  if (markers == 0 || markers > kMaxStreamMarkers) {
    return absl::InvalidArgumentError(absl::StrCat("rows.marker_count: is ", markers,
                                                   ", it must be from 1 to ", kMaxStreamMarkers));
  }
  for (const auto& [name, size] :
       {std::pair("x_px", rows.x_px_size()), std::pair("y_px", rows.y_px_size())}) {
    if (static_cast<size_t>(size) == count * markers) continue;
    return absl::InvalidArgumentError(absl::StrCat("rows.", name, ": has ", size, " values, and ",
                                                   count, " rows of ", markers, " markers have ",
                                                   count * markers));
  }
  std::vector<Observation> result(count);
  for (size_t i = 0; i < count; ++i) {
    result[i].time_ns = rows.time_ns(static_cast<int>(i));
    result[i].markers.resize(markers);
    for (size_t m = 0; m < markers; ++m) {
      const int at = static_cast<int>(i * markers + m);
      MarkerObservation& marker = result[i].markers[m];
      marker.visible = std::isfinite(rows.x_px(at)) && std::isfinite(rows.y_px(at));
      if (marker.visible) marker.centre_px = {rows.x_px(at), rows.y_px(at)};
    }
  }
  return result;
}

void SetTriangulatedPoint(const TriangulatedPoint& point, v1::TriangulatedPoint* proto) {
  proto->set_time_ns(point.rig_time_ns);
  proto->set_marker(static_cast<uint32_t>(point.marker));
  *proto->mutable_position_m() = wire::ToProto(point.position_m);
  for (int row = 0; row < 3; ++row) {
    for (int column = row; column < 3; ++column) {
      proto->add_covariance_m2(point.covariance_m2(row, column));
    }
  }
  proto->set_camera_count(static_cast<uint32_t>(point.views.size()));
  proto->set_error_px(point.error_px);
}

// One client's stream: read a message, make its points, write them, read the next. One of these
// steps runs at a time, so that nothing needs a lock. Lives until OnDone.
class TriangulationStream final : public TriangulationReactor {
 public:
  explicit TriangulationStream(TriangulationEnvironment* environment) : environment_(*environment) {
    StartRead(&request_);
  }

  void OnReadDone(bool ok) override {
    environment_.tasks.Post([this, ok] { Take(/*end=*/!ok); });
  }
  void OnWriteDone(bool ok) override {
    if (!ok) return End(absl::CancelledError("the client has gone"));
    WriteNext();
  }
  void OnDone() override {
    --environment_.open_streams;
    delete this;
  }

 private:
  // On the thread of the tasks.
  void Take(bool end) {
    absl::Status status;
    try {
      status = end ? TakePoints(true) : TakeRequest();
    } catch (const std::exception& error) {
      spdlog::error("Triangulate: an unexpected fault: {}", error.what());
      status = absl::InternalError(absl::StrCat("an unexpected fault: ", error.what()));
    }
    if (!status.ok()) return End(status);
    ended_ = end;
    WriteNext();
  }

  absl::Status TakeRequest() {
    RIGCAL_RETURN_IF_ERROR(wire::FaultOf(request_));
    if (request_.has_start()) return Start(request_.start());
    if (!request_.has_rows()) {
      return absl::InvalidArgumentError("content: neither start nor rows is set");
    }
    if (!stream_) return absl::InvalidArgumentError("the first message must be start");
    const v1::TriangulateRows& rows = request_.rows();
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<Observation> observations, RowsOf(rows));
    RIGCAL_RETURN_IF_ERROR(stream_->Add(rows.camera(), observations));
    return TakePoints(false);
  }

  absl::Status Start(const v1::TriangulateStart& start) {
    if (stream_) return absl::InvalidArgumentError("start comes twice");
    RIGCAL_ASSIGN_OR_RETURN(Calibration calibration, CalibrationToUse(start, environment_.store));
    const RowStreamOptions options = StreamOptionsOf(start, *calibration.result);
    RIGCAL_ASSIGN_OR_RETURN(stream_, RowStream::Create(*std::move(calibration.result), options));
    v1::TriangulateStarted& started = *responses_.emplace_back().mutable_started();
    started.set_calibration_id(calibration.id);
    const CalibrationResult& result = stream_->calibration();
    for (const CalibratedCamera& camera : result.cameras) {
      const bool taken = options.cameras.empty() ||
                         std::ranges::find(options.cameras, camera.camera) != options.cameras.end();
      if (taken) started.add_cameras(camera.camera);
    }
    for (const auto& point : result.target.given.points) started.add_labels(point.label);
    started.set_has_calibration_covariance(!result.camera_covariance.empty());
    return absl::OkStatus();
  }

  absl::Status TakePoints(bool end) {
    if (!stream_) return absl::OkStatus();
    RIGCAL_ASSIGN_OR_RETURN(const Triangulation triangulation, stream_->Take(end));
    counts_.set_points(counts_.points() + triangulation.points.size());
    counts_.set_alone(counts_.alone() + triangulation.alone_count);
    counts_.set_no_ray(counts_.no_ray() + triangulation.no_ray_count);
    counts_.set_disagree(counts_.disagree() + triangulation.disagree_count);
    for (const auto& [camera, count] : triangulation.left_out) {
      counts_.set_left_out(counts_.left_out() + count);
    }
    counts_.set_late_rows(stream_->late_row_count());
    for (size_t i = 0; i < triangulation.points.size(); ++i) {
      if (i % kPointsPerMessage == 0) responses_.emplace_back();
      SetTriangulatedPoint(triangulation.points[i], responses_.back().add_points());
    }
    if (end && triangulation.points.empty()) responses_.emplace_back();
    if (!responses_.empty()) *responses_.back().mutable_counts() = counts_;
    return absl::OkStatus();
  }

  void WriteNext() {
    if (next_response_ < responses_.size()) {
      StartWrite(&responses_[next_response_++]);
      return;
    }
    responses_.clear();
    next_response_ = 0;
    if (ended_) return End(absl::OkStatus());
    request_.Clear();
    StartRead(&request_);
  }

  void End(const absl::Status& status) { Finish(wire::ToGrpc(status)); }

  TriangulationEnvironment& environment_;
  v1::TriangulateRequest request_;
  std::optional<RowStream> stream_;
  std::vector<v1::TriangulateResponse> responses_;  // to be written
  size_t next_response_ = 0;
  v1::TriangulateCounts counts_;
  bool ended_ = false;  // the client sends nothing more
};

// Refused when it opens.
class RefusedTriangulation final : public TriangulationReactor {
 public:
  explicit RefusedTriangulation(const absl::Status& reason) { Finish(wire::ToGrpc(reason)); }
  void OnDone() override { delete this; }
};

class TriangulationService final : public v1::TriangulationService::CallbackService {
 public:
  explicit TriangulationService(Store* store) : environment_{store} { environment_.tasks.Start(); }
  // After the server has ended every stream.
  ~TriangulationService() override { environment_.tasks.Shutdown(); }

  TriangulationReactor* Triangulate(grpc::CallbackServerContext*) override {
    if (++environment_.open_streams > kMaxTriangulations) {
      --environment_.open_streams;
      return new RefusedTriangulation(absl::ResourceExhaustedError(
          absl::StrCat(kMaxTriangulations, " triangulations are open, which is the limit")));
    }
    return new TriangulationStream(&environment_);
  }

 private:
  TriangulationEnvironment environment_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeTriangulationService(Store* store) {
  return std::make_unique<TriangulationService>(store);
}

}  // namespace rigcal::server
