// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "common/wire/grpc_status.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::get_accuracy_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

// Two cameras 2 m apart that look along z, side by side; the second one's translation is known to
// 1 mm along x.
Calibration TwoCameras() {
  Calibration calibration;
  calibration.rig = "default";
  calibration.state = CalibrationState::kSucceeded;
  CalibrationResult result;
  result.scale_known = true;
  result.reference_camera = "a";
  for (const double x_m : {0.0, 2.0}) {
    CalibratedCamera camera;
    camera.camera = x_m == 0 ? "a" : "b";
    camera.image_size_px = {1280, 1024};
    camera.intrinsics = {DistortionModel::kBrownConrady, 500, 500, 640, 512, {}};
    camera.cam_from_rig.translation_m = {-x_m, 0, 0};
    result.cameras.push_back(camera);
  }
  result.camera_covariance.assign(21, 0);
  result.camera_covariance[9] = 1e-6;  // row 3, column 3
  result.target.given.marker_positions_m = {0, 0.13, 0.39};
  result.target.scale_sigma_rel = 0.01;
  result.wand_volume = WandVolume{{0, -1, 4}, {2, 1, 6}};
  calibration.result = result;
  return calibration;
}

v1::GetAccuracyRequest AtPoint(double x, double y, double z) {
  v1::GetAccuracyRequest request;
  v1::Vector3* point = request.add_points_m();
  point->set_x(x);
  point->set_y(y);
  point->set_z(z);
  return request;
}

class GetAccuracy : public rigcal::testing::RpcFixture {
 protected:
  absl::StatusOr<v1::GetAccuracyResponse> Ask(const v1::GetAccuracyRequest& request) {
    const auto stub = v1::CalibrationService::NewStub(channel());
    grpc::ClientContext context;
    v1::GetAccuracyResponse response;
    const absl::Status status = wire::FromGrpc(stub->GetAccuracy(&context, request, &response));
    if (!status.ok()) return status;
    return response;
  }
  // Of a calibration that is in the store.
  absl::StatusOr<v1::GetAccuracyResponse> AccuracyOf(const Calibration& calibration,
                                                     v1::GetAccuracyRequest request) {
    const absl::StatusOr<Calibration> stored = store().CreateCalibration(calibration);
    if (!stored.ok()) return stored.status();
    request.set_id(stored->id);
    return Ask(request);
  }
};

TEST_F(GetAccuracy, PointBetweenTwoCameras) {
  ASSERT_OK_AND_ASSIGN(const v1::GetAccuracyResponse response,
                       AccuracyOf(TwoCameras(), AtPoint(1, 0, 5)));
  EXPECT_EQ(response.id(), "c-000001");
  EXPECT_EQ(response.sigma_px(), 0.3);
  EXPECT_EQ(response.grid_step_m(), 0);
  ASSERT_EQ(response.points_size(), 1);
  const v1::PointAccuracy& point = response.points(0);
  EXPECT_EQ(point.camera_count(), 2u);
  // The mean of two rows: sigma z / f / sqrt(2).
  EXPECT_NEAR(point.noise_sigma_m().y(), 0.3 * 5 / 500 / std::sqrt(2), 1e-9);
  // Disparity f b / z: sigma sqrt(2) z^2 / (f b).
  EXPECT_NEAR(point.noise_sigma_m().z(), 0.3 * std::sqrt(2) * 25 / (500 * 2), 1e-9);
  // An error of the baseline scales the depth: 1 mm of 2 m.
  EXPECT_NEAR(std::hypot(point.noise_sigma_m().z(), 5 * 0.001 / 2), point.shape_sigma_m().z(),
              1e-9);
  EXPECT_NEAR(std::hypot(point.shape_sigma_m().z(), 0.01 * 5), point.sigma_m().z(), 1e-9);
  EXPECT_NEAR(point.total_m(),
              std::hypot(point.sigma_m().x(), point.sigma_m().y(), point.sigma_m().z()), 1e-12);
  EXPECT_EQ(response.shape().count(), 1u);
}

TEST_F(GetAccuracy, PointThatNobodySeesHasNoError) {
  ASSERT_OK_AND_ASSIGN(const v1::GetAccuracyResponse response,
                       AccuracyOf(TwoCameras(), AtPoint(1, 0, -5)));
  ASSERT_EQ(response.points_size(), 1);
  EXPECT_EQ(response.points(0).camera_count(), 0u);
  EXPECT_FALSE(response.points(0).has_sigma_m());
  EXPECT_EQ(response.shape().count(), 0u);
  EXPECT_FALSE(response.shape().has_worst_point_m());
}

TEST_F(GetAccuracy, GridAndPointsTogether) {
  v1::GetAccuracyRequest request = AtPoint(1, 0, 5);
  request.set_grid_step_m(0.5);
  request.set_sigma_px(1);
  ASSERT_OK_AND_ASSIGN(const v1::GetAccuracyResponse response, AccuracyOf(TwoCameras(), request));
  EXPECT_EQ(response.points_size(), 1);
  EXPECT_EQ(response.grid_size(), 125);
  EXPECT_EQ(response.with_scale().count(), 126u);
  EXPECT_EQ(response.sigma_px(), 1);
}

TEST_F(GetAccuracy, RefusesWhatHasNoResult) {
  Calibration calibration = TwoCameras();
  calibration.state = CalibrationState::kFailed;
  calibration.result.reset();
  EXPECT_THAT(AccuracyOf(calibration, {}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("it failed")));
  calibration = TwoCameras();
  calibration.result->scale_known = false;
  EXPECT_THAT(AccuracyOf(calibration, {}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("scale")));
  calibration = TwoCameras();
  calibration.result->camera_covariance.clear();
  EXPECT_THAT(AccuracyOf(calibration, {}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("covariance")));
  v1::GetAccuracyRequest request;
  request.set_sigma_px(-1);
  EXPECT_THAT(AccuracyOf(TwoCameras(), request),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("sigma_px")));
}

TEST_F(GetAccuracy, NamesACalibrationThatDoesNotExist) {
  v1::GetAccuracyRequest request;
  request.set_id("c-000404");
  EXPECT_THAT(Ask(request), StatusIs(absl::StatusCode::kNotFound, HasSubstr("c-000404")));
}

}  // namespace
}  // namespace rigcal::server::get_accuracy_test
