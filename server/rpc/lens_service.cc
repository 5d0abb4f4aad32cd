// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <map>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/camera/camera_export.h"
#include "common/lens/lens_model.h"
#include "common/status/status_macros.h"
#include "common/wire/camera_wire.h"
#include "rigcal/v1/lens_service.grpc.pb.h"
#include "server/lens/lens_book.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/services.h"

namespace rigcal::server {
namespace {

static_assert(static_cast<int>(SessionLens::State::kReading) == v1::Lens::STATE_READING);
static_assert(static_cast<int>(SessionLens::State::kCollecting) == v1::Lens::STATE_COLLECTING);
static_assert(static_cast<int>(SessionLens::State::kSolving) == v1::Lens::STATE_SOLVING);
static_assert(static_cast<int>(SessionLens::State::kSolved) == v1::Lens::STATE_SOLVED);
static_assert(static_cast<int>(SessionLens::State::kFailed) == v1::Lens::STATE_FAILED);

// As pages show it: a hundred views are some ten thousand corners.
float Tenth(double pixel) { return static_cast<float>(std::round(10 * pixel) / 10); }

void SetViews(const SessionLens& lens, v1::Lens* proto) {
  std::map<int64_t, const LensViewResult*> results;
  if (lens.solution) {
    for (size_t i = 0; i < lens.solution_times_ns.size(); ++i) {
      results[lens.solution_times_ns[i]] = &lens.solution->view_results[i];
    }
  }
  for (const BoardView& view : lens.seen.views) {
    v1::LensView& added = *proto->add_views();
    added.set_time_ns(view.time_ns);
    for (const BoardCorner& corner : view.corners) {
      added.add_x_px(Tenth(corner.pixel.x()));
      added.add_y_px(Tenth(corner.pixel.y()));
    }
    const auto result = results.find(view.time_ns);
    if (result == results.end()) continue;
    added.set_rms_px(result->second->rms_px);
    added.set_tilt_deg(result->second->tilt_deg);
    added.set_left_out(result->second->left_out);
  }
}

absl::Status SetResult(const CameraDescription& camera, const LensSolution& solution,
                       v1::LensResult* proto) {
  proto->set_model(std::string(LensModelName(solution.model)));
  *proto->mutable_intrinsics() = wire::ToProto(solution.intrinsics);
  proto->mutable_sigmas()->Assign(solution.sigmas.begin(), solution.sigmas.end());
  proto->set_rms_px(solution.rms_px);
  proto->set_held_out_rms_px(solution.held_out_rms_px);
  proto->set_corner_count(static_cast<uint32_t>(solution.corners));
  proto->set_view_count(static_cast<uint32_t>(solution.views));
  for (const LensCandidate& candidate : solution.candidates) {
    v1::LensCandidate& added = *proto->add_candidates();
    added.set_model(std::string(LensModelName(candidate.model)));
    added.set_rms_px(candidate.rms_px);
    added.set_held_out_rms_px(candidate.held_out_rms_px);
  }
  if (solution.halves) {
    proto->set_halves_median_px(solution.halves->median_px);
    proto->set_halves_p95_px(solution.halves->p95_px);
  }
  proto->set_blind_share(solution.blind_share);
  for (const std::string& sentence : solution.advice) proto->add_advice(sentence);
  RIGCAL_ASSIGN_OR_RETURN(*proto->mutable_opencv_yaml(),
                          CameraExportText({.camera = camera.camera,
                                            .image_size_px = camera.image_size_px,
                                            .intrinsics = solution.intrinsics,
                                            .cam_from_rig = std::nullopt}));
  return absl::OkStatus();
}

// Not a number and infinity cannot be coloured, and JSON has no words for them.
double FiniteOrZero(double value) { return std::isfinite(value) ? value : 0; }

void SetUncertainty(const LensUncertainty& uncertainty, v1::LensMap* proto) {
  proto->set_columns(LensDifference::kColumns);
  proto->set_rows(LensDifference::kRows);
  for (const double value : uncertainty.map_px) proto->add_values_px(static_cast<float>(value));
  proto->set_median_px(uncertainty.median_px);
  proto->set_p95_px(uncertainty.p95_px);
}

void SetNextPose(const SessionLens& lens, v1::LensPose* proto) {
  const NextView& next = lens.next_view;
  proto->set_words(next.words);
  for (const Eigen::Vector2d& pixel : next.outline_px) {
    proto->add_outline_x_px(Tenth(pixel.x()));
    proto->add_outline_y_px(Tenth(pixel.y()));
  }
  proto->set_expected_p95_px(FiniteOrZero(next.expected_p95_px));
  if (lens.solution) *proto->mutable_cam_from_board() = wire::ToProto(next.cam_from_board);
}

class LensService final : public v1::LensService::Service {
 public:
  explicit LensService(const Store* store) : book_(store) {}

  grpc::Status GetLens(grpc::ServerContext*, const v1::GetLensRequest* request,
                       v1::GetLensResponse* response) override {
    return GuardedCall("GetLens", [&]() -> absl::Status {
      if (request->camera().empty()) return absl::InvalidArgumentError("camera: none is named");
      RIGCAL_ASSIGN_OR_RETURN(const LensBook::Answer answer,
                              book_.Get(request->session_id(), request->camera()));
      const SessionLens& lens = *answer.lens;
      v1::Lens& proto = *response->mutable_lens();
      proto.set_session_id(answer.session.id);
      proto.set_camera(answer.camera.camera);
      proto.set_state(static_cast<v1::Lens::State>(lens.state));
      proto.set_problem(lens.problem);
      proto.set_stored_count(answer.stored_count);
      *proto.mutable_image_size_px() = wire::ToProto(answer.camera.image_size_px);
      proto.set_board(answer.session.target.board);
      proto.set_has_lens(answer.camera.intrinsics.has_value());
      proto.set_observation_count(lens.seen.observation_count);
      proto.set_board_count(lens.seen.board_count);
      proto.set_alike_count(static_cast<uint64_t>(lens.seen.alike));
      proto.set_blurred_count(static_cast<uint64_t>(lens.seen.blurred));
      SetViews(lens, &proto);
      proto.set_covered_share(lens.covered_share);
      for (const std::string& side : lens.bare_sides) proto.add_bare_sides(side);
      if (!lens.next_view.words.empty()) SetNextPose(lens, proto.mutable_next_pose());
      if (!lens.solution) return absl::OkStatus();
      if (!lens.solution->uncertainty.map_px.empty()) {
        SetUncertainty(lens.solution->uncertainty, proto.mutable_uncertainty());
      }
      RIGCAL_RETURN_IF_ERROR(SetResult(answer.camera, *lens.solution, proto.mutable_result()));
      proto.mutable_result()->set_observation_count(lens.solution_observation_count);
      return absl::OkStatus();
    });
  }

 private:
  LensBook book_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeLensService(Store* store) {
  return std::make_unique<LensService>(store);
}

}  // namespace rigcal::server
