// SPDX-License-Identifier: Apache-2.0
// Residuals and exports of stored calibrations, by gRPC and as JSON routes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <future>
#include <string>

#include "common/wire/grpc_status.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::export_calibration_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::testing::StartsWith;

Calibration TwoCameras() {
  Calibration calibration;
  calibration.rig = "default";
  calibration.state = CalibrationState::kSucceeded;
  CalibrationResult result;
  result.scale_known = true;
  result.target.given.marker_positions_m = {0, 0.13, 0.39};
  for (const char* const name : {"a", "b"}) {
    CalibratedCamera camera;
    camera.camera = name;
    camera.image_size_px = {1280, 1024};
    camera.intrinsics = {DistortionModel::kBrownConrady, 500, 500, 640, 512, {}};
    result.cameras.push_back(camera);
    CameraResiduals residuals;
    residuals.camera = name;
    residuals.image_size_px = camera.image_size_px;
    residuals.vectors = {{10, 20, 0.5, -0.25, false}, {30, 40, 8, 0, true}};
    residuals.bin_px = 0.5;
    residuals.inlier_counts = {0, 7};
    residuals.outlier_counts = {0, 1};
    result.residuals.push_back(residuals);
  }
  calibration.result = result;
  return calibration;
}

class ExportCalibration : public rigcal::testing::RpcFixture {
 protected:
  template <typename Response, typename Request, typename Method>
  absl::StatusOr<Response> Ask(Method method, const Request& request) {
    const auto stub = v1::CalibrationService::NewStub(channel());
    grpc::ClientContext context;
    Response response;
    const absl::Status status = wire::FromGrpc((stub.get()->*method)(&context, request, &response));
    if (!status.ok()) return status;
    return response;
  }
  std::string Store(const Calibration& calibration) {
    const absl::StatusOr<Calibration> stored = store().CreateCalibration(calibration);
    EXPECT_THAT(stored, IsOk());
    return stored.ok() ? stored->id : "";
  }
  absl::StatusOr<v1::GetResidualsResponse> Residuals(const std::string& id,
                                                     const std::string& camera = "") {
    v1::GetResidualsRequest request;
    request.set_id(id);
    request.set_camera(camera);
    return Ask<v1::GetResidualsResponse>(&v1::CalibrationService::Stub::GetResiduals, request);
  }
  absl::StatusOr<v1::ExportCalibrationResponse> Export(const std::string& id,
                                                       const std::string& format,
                                                       bool undistorted = false) {
    v1::ExportCalibrationRequest request;
    request.set_id(id);
    request.set_format(format);
    request.set_undistorted(undistorted);
    return Ask<v1::ExportCalibrationResponse>(&v1::CalibrationService::Stub::ExportCalibration,
                                              request);
  }
};

TEST_F(ExportCalibration, ResidualsOfAllOrOneCamera) {
  const std::string id = Store(TwoCameras());
  ASSERT_OK_AND_ASSIGN(const v1::GetResidualsResponse all, Residuals(id));
  EXPECT_EQ(all.id(), id);
  ASSERT_EQ(all.cameras_size(), 2);
  const v1::CameraResiduals& first = all.cameras(0);
  EXPECT_EQ(first.camera(), "a");
  EXPECT_EQ(first.image_size_px().width(), 1280u);
  EXPECT_THAT(first.x_px(), ElementsAre(10, 30));
  EXPECT_THAT(first.dy_px(), ElementsAre(-0.25, 0));
  EXPECT_THAT(first.outlier(), ElementsAre(false, true));
  EXPECT_THAT(first.inlier_counts(), ElementsAre(0, 7));
  EXPECT_THAT(first.outlier_counts(), ElementsAre(0, 1));
  ASSERT_OK_AND_ASSIGN(const v1::GetResidualsResponse one, Residuals(id, "b"));
  ASSERT_EQ(one.cameras_size(), 1);
  EXPECT_EQ(one.cameras(0).camera(), "b");
}

TEST_F(ExportCalibration, SaysWhyThereAreNoResiduals) {
  EXPECT_THAT(Residuals("c-000404"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("c-000404")));
  EXPECT_THAT(Residuals(Store(TwoCameras()), "top"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("'top'")));
  Calibration calibration = TwoCameras();
  calibration.result->residuals.clear();
  EXPECT_THAT(Residuals(Store(calibration)),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("calibrate")));
  calibration.state = CalibrationState::kFailed;
  calibration.result.reset();
  EXPECT_THAT(Residuals(Store(calibration)),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("it failed")));
}

TEST_F(ExportCalibration, ListsFormatsWithWhatTheyLack) {
  Calibration calibration = TwoCameras();
  calibration.result->scale_known = false;
  calibration.result->unit_camera = "b";
  v1::ListExportsRequest request;
  request.set_id(Store(calibration));
  ASSERT_OK_AND_ASSIGN(const auto listed, Ask<v1::ListExportsResponse>(
                                              &v1::CalibrationService::Stub::ListExports, request));
  ASSERT_GE(listed.formats_size(), 2);
  EXPECT_EQ(listed.formats(0).name(), "opencv");
  EXPECT_EQ(listed.formats(1).name(), "json");
  // Every other one promises metres.
  for (const v1::ExportFormat& format : listed.formats()) {
    if (format.name() == "json") {
      EXPECT_THAT(format.problem(), IsEmpty());
    } else {
      EXPECT_THAT(format.problem(), HasSubstr("scale")) << format.name();
    }
  }
}

TEST_F(ExportCalibration, GivesEachFormatAsAFile) {
  const std::string id = Store(TwoCameras());
  v1::ListExportsRequest request;
  request.set_id(id);
  ASSERT_OK_AND_ASSIGN(const auto listed, Ask<v1::ListExportsResponse>(
                                              &v1::CalibrationService::Stub::ListExports, request));
  for (const v1::ExportFormat& format : listed.formats()) {
    const auto file = Export(id, format.name());
    if (format.problem().empty()) {
      ASSERT_THAT(file, IsOk());
      EXPECT_THAT(file->file_name(), StartsWith(id + "-" + format.name() + ".")) << format.name();
      EXPECT_FALSE(file->content().empty()) << format.name();
    } else {
      EXPECT_THAT(file, StatusIs(absl::StatusCode::kFailedPrecondition, format.problem()));
    }
  }
  ASSERT_OK_AND_ASSIGN(const auto zip, Export(id, "opencv"));
  EXPECT_EQ(zip.file_name(), id + "-opencv.zip");
  EXPECT_EQ(zip.content_type(), "application/zip");
  EXPECT_THAT(zip.content(), StartsWith("PK"));
  ASSERT_OK_AND_ASSIGN(const auto json, Export(id, "json"));
  EXPECT_THAT(json.content(), HasSubstr("\"image_size_px\""));
  Calibration with_covariance = TwoCameras();
  with_covariance.result->camera_covariance = {0.25, 0.125, 0.5};
  ASSERT_OK_AND_ASSIGN(const auto whole, Export(Store(with_covariance), "json"));
  EXPECT_THAT(whole.content(), HasSubstr("\"camera_covariance\": [0.25, 0.125, 0.5]"));
  EXPECT_THAT(Export(id, "nothing"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("opencv, json")));
  EXPECT_THAT(Export("c-000404", "json"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("404")));
}

TEST_F(ExportCalibration, UndistortedIsAPinholeThatEveryFormatHolds) {
  Calibration calibration = TwoCameras();
  for (CalibratedCamera& camera : calibration.result->cameras) {
    camera.intrinsics.distortion = {-0.3, 0.1, 0, 0, 0};
  }
  calibration.result->camera_covariance = {0.25, 0.125, 0.5};
  const std::string id = Store(calibration);
  for (const bool undistorted : {false, true}) {
    v1::ListExportsRequest request;
    request.set_id(id);
    request.set_undistorted(undistorted);
    ASSERT_OK_AND_ASSIGN(
        const auto listed,
        Ask<v1::ListExportsResponse>(&v1::CalibrationService::Stub::ListExports, request));
    for (const v1::ExportFormat& format : listed.formats()) {
      if (format.name() != "blender") continue;
      EXPECT_EQ(format.problem().empty(), undistorted);
    }
  }
  EXPECT_THAT(Export(id, "blender"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("--undistorted")));
  ASSERT_OK_AND_ASSIGN(const auto file, Export(id, "blender", true));
  EXPECT_EQ(file.file_name(), id + "-blender-undistorted.py");
  ASSERT_OK_AND_ASSIGN(const auto json, Export(id, "json", true));
  EXPECT_EQ(json.content().find("-0.3"), std::string::npos);
  EXPECT_EQ(json.content().find("camera_covariance"), std::string::npos);
}

TEST_F(ExportCalibration, ALensMayBeOffByAsMuchAsTheCallerSays) {
  Calibration calibration = TwoCameras();
  for (CalibratedCamera& camera : calibration.result->cameras) {
    camera.intrinsics.distortion = {-0.01, 0, 0, 0, 0};
  }
  const std::string id = Store(calibration);
  const auto problem_of_blender = [&](double max_error_px) {
    v1::ListExportsRequest request;
    request.set_id(id);
    request.set_max_error_px(max_error_px);
    request.set_up_axis("z");
    const auto listed =
        Ask<v1::ListExportsResponse>(&v1::CalibrationService::Stub::ListExports, request);
    EXPECT_THAT(listed, IsOk());
    for (const v1::ExportFormat& format : listed->formats()) {
      if (format.name() == "blender") return format.problem();
    }
    return std::string("not listed");
  };
  EXPECT_THAT(problem_of_blender(0), HasSubstr("more than 0.5"));
  EXPECT_EQ(problem_of_blender(100), "");
  v1::ExportCalibrationRequest request;
  request.set_id(id);
  request.set_format("blender");
  const auto ask = [&] {
    return Ask<v1::ExportCalibrationResponse>(&v1::CalibrationService::Stub::ExportCalibration,
                                              request);
  };
  EXPECT_THAT(ask(), StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("more than 0.5")));
  request.set_max_error_px(100);
  ASSERT_OK_AND_ASSIGN(const auto as_it_is, ask());
  request.set_up_axis("y");
  ASSERT_OK_AND_ASSIGN(const auto turned, ask());
  EXPECT_NE(as_it_is.content(), turned.content());
  request.set_up_axis("x");
  EXPECT_THAT(ask(), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("up_axis")));
  request.set_up_axis("");
  for (const double wrong : {-1.0, 101.0, std::nan("")}) {
    request.set_max_error_px(wrong);
    EXPECT_THAT(ask(), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("max_error_px")));
  }
}

TEST_F(ExportCalibration, RoutesServeTheFileWithItsNameAndType) {
  const std::string id = Store(TwoCameras());
  const std::unique_ptr<ApiGateway> gateway = rpc_->MakeApiGateway();
  const ApiMatch match = MatchApiRoute("GET", "/v1/calibrations/" + id + "/exports/opencv");
  ASSERT_NE(match.route, nullptr);
  std::promise<ApiGateway::Work> work;
  gateway->Call({.route = match.route,
                 .variables = match.variables,
                 .parameters = {},
                 .body = "",
                 .known_etag = "",
                 .peer = {},
                 .address = "127.0.0.1"},
                [&](ApiGateway::Work made) { work.set_value(std::move(made)); });
  const ApiAnswer answer = work.get_future().get()();
  ASSERT_THAT(answer.status, IsOk());
  EXPECT_THAT(answer.body->text, StartsWith("PK"));
  EXPECT_EQ(answer.content_type, "application/zip");
  EXPECT_EQ(answer.file_name, id + "-opencv.zip");
  EXPECT_THAT(answer.info, IsEmpty());
}

}  // namespace
}  // namespace rigcal::server::export_calibration_test
