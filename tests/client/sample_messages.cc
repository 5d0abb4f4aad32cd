// SPDX-License-Identifier: Apache-2.0
#include "tests/client/sample_messages.h"

#include <numbers>

#include "common/wire/camera_wire.h"
#include "common/wire/time_wire.h"

namespace rigcal::testing {
namespace {

void SetFigures(double scale, v1::ErrorFigures* figures) {
  figures->set_mean_px(0.25 * scale);
  figures->set_rms_px(0.375 * scale);
  figures->set_median_px(0.125 * scale);
  figures->set_p95_px(0.75 * scale);
  figures->set_marker_count(100);
}

void AddCamera(const std::string& name, const RigidTransform& cam_from_rig,
               v1::Calibration* calibration) {
  v1::CalibratedCamera* camera = calibration->add_cameras();
  camera->set_camera(name);
  camera->mutable_image_size_px()->set_width(1280);
  camera->mutable_image_size_px()->set_height(1024);
  *camera->mutable_cam_from_rig() = wire::ToProto(cam_from_rig);
  *camera->mutable_intrinsics() = wire::ToProto(Intrinsics{.fx_px = 1250.5,
                                                           .fy_px = 1251.5,
                                                           .cx_px = 640.25,
                                                           .cy_px = 512.75,
                                                           .distortion = {-0.2, 0.1, 0, 0, 0.05}});
  camera->set_clock_id(name);
  camera->set_time_offset_s(-0.00815);
  camera->set_time_rate_ppm(1.5);
  camera->set_time_epoch_s(12.5);
  camera->set_time_offset_estimated(true);
  v1::Residuals* residuals = camera->mutable_residuals();
  v1::ErrorFigures* all = residuals->mutable_all();
  all->set_mean_px(0.5);
  all->set_rms_px(0.75);
  all->set_median_px(0.25);
  all->set_p95_px(1.5);
  all->set_marker_count(1800);
  residuals->set_observation_count(600);
  residuals->set_outlier_count(12);
  SetFigures(1, residuals->mutable_inlier());
  SetFigures(2, camera->mutable_held_out());
  SetFigures(3, camera->mutable_leave_one_out());
  v1::CameraUncertainty* sigma = camera->mutable_uncertainty();
  sigma->mutable_position_sigma_m()->set_x(0.0003);
  sigma->mutable_position_sigma_m()->set_z(0.0004);
  sigma->mutable_rotation_sigma_rad()->set_y(0.0001);
  camera->set_observation_count(619);
  camera->set_wand_count(610);
}

v1::RefusalCount MakeRefusal(const std::string& camera, v1::RefusalReason reason, uint32_t count,
                             const std::string& example) {
  v1::RefusalCount refusal;
  refusal.set_camera(camera);
  refusal.set_reason(reason);
  refusal.set_count(count);
  refusal.set_example(example);
  return refusal;
}

void SetTarget(v1::Target* target) {
  target->set_kind(v1::Target::KIND_WAND);
  for (const double position_m : {0.0, 0.13, 0.39}) target->add_marker_positions_m(position_m);
  target->set_span_tolerance_m(0.002);
}

}  // namespace

v1::Calibration FullCalibration(const std::string& id) {
  v1::Calibration calibration;
  calibration.set_id(id);
  calibration.set_rig("rig");
  calibration.set_version(3);
  calibration.add_session_ids("wave");
  calibration.set_state(v1::Calibration::STATE_SUCCEEDED);
  calibration.set_scale_known(true);
  calibration.set_reference_camera("left");
  calibration.set_instant_count(614);
  AddCamera("left", RigidTransform::Identity(), &calibration);
  // Looks along -x of the rig from 3 m to the right: a quarter turn about y.
  const RigidTransform rig_from_right(
      Eigen::Quaterniond(Eigen::AngleAxisd(-std::numbers::pi / 2, Eigen::Vector3d::UnitY())),
      Eigen::Vector3d(3, 0, 1.5));
  AddCamera("right", rig_from_right.Inverse(), &calibration);
  v1::CalibratedTarget* target = calibration.mutable_target();
  SetTarget(target->mutable_given());
  *target->mutable_marker_positions_m() = target->given().marker_positions_m();
  target->set_length_error_rms_m(0.00058);
  for (const double length_m : {0.13, 0.26}) {
    v1::SpanError* span = target->add_spans();
    span->set_length_m(length_m);
    span->set_mean_error_m(0.0001);
    span->set_error_rms_m(0.00058);
    span->set_count(600);
  }
  *calibration.add_refused() = MakeRefusal("left", v1::REFUSAL_REASON_CLOCK_EPOCH_WITHOUT_OFFSET, 6,
                                           "row 620 of left.csv: the clock jumps back 398 ms");
  v1::Finding* finding = calibration.add_findings();
  finding->set_kind(v1::FINDING_KIND_CLOCK_OFFSET);
  finding->set_severity(v1::FINDING_SEVERITY_WARNING);
  finding->set_camera("left");
  finding->set_value(-8.15);
  finding->set_unit("ms");
  finding->set_advice("check the trigger cable");
  calibration.set_observation_digest("00ff");
  calibration.mutable_quality()->set_grade(v1::Quality::GRADE_USABLE);
  calibration.mutable_quality()->add_reasons("left is late");
  *calibration.mutable_run()->mutable_solve_duration() = wire::ToDuration(1.25);
  calibration.mutable_run()->mutable_create_time()->set_seconds(1'700'000'000);
  return calibration;
}

v1::Session FullSession(const std::string& id) {
  v1::Session session;
  session.set_id(id);
  session.set_rig("rig");
  session.set_title("first try");
  session.set_state(v1::Session::STATE_CAPTURING);
  SetTarget(session.mutable_target());
  for (const char* name : {"left", "right"}) {
    v1::SessionCamera* camera = session.add_cameras();
    camera->mutable_description()->set_camera(name);
    camera->set_agent_id(std::string("pc-") + name);
    camera->set_connected(true);
    camera->set_observation_count(619);
    camera->set_wand_count(610);
    camera->add_clock_epochs()->set_observation_count(619);
  }
  session.mutable_cameras(0)->set_ended(true);
  *session.mutable_cameras(1)->add_refused() =
      MakeRefusal("", v1::REFUSAL_REASON_CSV_FIELD_COUNT, 2, "right.csv:17: 6 fields, 7 expected");
  session.mutable_create_time()->set_seconds(1'700'000'000);
  session.mutable_start_time()->set_seconds(1'700'000'060);
  session.set_observation_count(1238);
  session.set_wand_count(1220);
  return session;
}

v1::Calibration TrueCalibration(const SimulatedWorld& world) {
  v1::Calibration calibration;
  calibration.set_id("cal-true");
  calibration.set_state(v1::Calibration::STATE_SUCCEEDED);
  calibration.set_scale_known(true);
  const RigidTransform world_from_rig = world.cameras()[0].cam_from_rig.Inverse();
  for (const SimulatedCamera& truth : world.cameras()) {
    AddCamera(truth.description.camera, truth.cam_from_rig * world_from_rig, &calibration);
    v1::CalibratedCamera* camera = calibration.mutable_cameras(calibration.cameras_size() - 1);
    // At its epoch, as the solver gives it, the clock having run off by its rate since its origin.
    const double since_origin_s =
        camera->time_epoch_s() - static_cast<double>(truth.clock_origin_ns) * 1e-9;
    camera->set_time_offset_s(truth.time_offset_s + truth.time_rate_ppm * 1e-6 * since_origin_s);
    camera->set_time_rate_ppm(truth.time_rate_ppm);
    *camera->mutable_intrinsics() = wire::ToProto(truth.true_intrinsics);
  }
  *calibration.mutable_target()->mutable_given() = wire::ToProto(world.target());
  for (const double position_m : world.true_target().marker_positions_m) {
    calibration.mutable_target()->add_marker_positions_m(position_m);
  }
  return calibration;
}

}  // namespace rigcal::testing
