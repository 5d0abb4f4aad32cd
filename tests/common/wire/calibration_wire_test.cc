// SPDX-License-Identifier: Apache-2.0
#include "common/wire/calibration_wire.h"

#include <gmock/gmock.h>
#include <google/protobuf/util/json_util.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "common/wire/calibration_result_wire.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::wire::calibration_wire_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::_;
using ::testing::HasSubstr;

Calibration FilledCalibration() {
  Calibration calibration;
  calibration.id = "c-000001";
  calibration.rig = "rig";
  calibration.version = 4;
  calibration.session_ids = {"s-1", "s-2"};
  calibration.state = CalibrationState::kSucceeded;
  calibration.options.seed = 9;
  calibration.options.known_distance = KnownDistance{"left", "right", 1.25, 0.003};
  calibration.options.intrinsics = Estimate::kAuto;
  calibration.create_utc_ns = 1'700'000'000'123'456'789;
  calibration.duration_s = 0.25;
  CalibrationResult result;
  result.scale_known = true;
  result.unit_camera = "right";
  result.reference_camera = "a";
  result.instant_count = 614;
  CalibratedCamera camera;
  camera.camera = "a";
  camera.image_size_px = {1280, 1024};
  camera.cam_from_rig = {Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY())),
                         Eigen::Vector3d(1, 2, 3)};
  camera.intrinsics = {DistortionModel::kBrownConrady, 1250, 1251, 640, 512, {-.2, .1, 0, 0, 0}};
  camera.clock_id = "clock";
  camera.time_offset_s = -0.00815;
  camera.line_delay_s = 1.5e-05;
  camera.line_delay_sigma_s = 2e-07;
  camera.clock_course = {{5'000'000'001, 0}, {9'000'000'000, -0.03}};
  camera.residuals.all = {1, 2, 3, 4, 5};
  camera.residuals.inlier = {6, 7, 8, 9, 10};
  camera.residuals.outlier_count = 11;
  camera.uncertainty.emplace();
  camera.uncertainty->position_sigma_m = {0.001, 0.002, 0.003};
  camera.leave_one_out = ErrorFigures{0.5, 0.6, 0.4, 1.0, 100};
  result.cameras.push_back(camera);
  result.target.given.marker_positions_m = {0, 0.13, 0.39};
  result.target.marker_positions_m = {0, 0.1301, 0.3902};
  result.target.spans.push_back({0.13, 0.0001, 0.0005, 300, 0.0006, 100});
  result.refused.push_back(
      {"a", RefusalReason::kCsvFieldCount, 3, "a.csv:7: 5 fields, expected 7"});
  result.findings.push_back({FindingKind::kClockOffset, "a", -8.15, "ms", "check the trigger",
                             FindingSeverity::kWarning});
  result.quality = {QualityGrade::kUsable, {"because"}};
  result.observation_digest = "abcd";
  calibration.result = result;
  return calibration;
}

TEST(CalibrationWire, StoredFormReadsBackEqual) {
  const std::string bytes = SerializeCalibration(FilledCalibration());
  ASSERT_OK_AND_ASSIGN(const Calibration back, ParseCalibration(bytes));
  EXPECT_EQ(SerializeCalibration(back), bytes);
  ASSERT_TRUE(back.result.has_value());
  EXPECT_EQ(back.result->cameras[0].time_offset_s, -0.00815);
  EXPECT_EQ(back.result->refused, FilledCalibration().result->refused);
  EXPECT_EQ(back.options, FilledCalibration().options);
  EXPECT_EQ(back.create_utc_ns, FilledCalibration().create_utc_ns);
}

TEST(CalibrationWire, KeepsFrameScaleAndWhatHoldsIt) {
  Calibration calibration = FilledCalibration();
  calibration.options.kind = SolveKind::kOrigin;
  calibration.options.parent_id = "c-000000";
  OriginRequest& origin = calibration.options.origin.emplace();
  origin.source = FrameSource::kPoints;
  origin.points = {{"A", 0, 0, 0, 0.001}, {"B", 1, 0, 0, 0}, {"C", 0, 1, 0, 0}};
  origin.measured = {{1, 2, 123'456, {{"a", 10, 20, 0.1, 0.01, 0.2}, {"b", 30, 40, 0.1, 0, 0.2}}}};
  origin.still_s = 0.7;
  origin.cameras_below = true;
  CalibrationFrame& frame = calibration.result->frame.emplace();
  frame.source = FrameSource::kPoints;
  frame.calibration_id = "c-000000";
  frame.residuals = {{"A", 0.001, 0.0005}};
  frame.residual_count = 3;
  frame.cameras = {"a"};
  calibration.result->scale =
      CalibrationScale{"c-000000", 1.01, 0.002, {{"the target", 0, 1, 2, 3}}};
  CalibrationInformation& information = calibration.result->information.emplace();
  information.groups = {{InformationGroup::Kind::kSpan, "s-1", 1, 2, "", 30}};
  information.parameters = {{"a", ParameterInformation::Kind::kRotation, "x", 0.1, {0.25F}}};
  information.calibration_id = "c-000000";
  information.stride = 3;
  const std::string bytes = SerializeCalibration(calibration);
  ASSERT_OK_AND_ASSIGN(const Calibration back, ParseCalibration(bytes));
  EXPECT_EQ(SerializeCalibration(back), bytes);
  EXPECT_EQ(back.options, calibration.options);
  EXPECT_EQ(back.result->frame->residuals[0].name, "A");
  EXPECT_EQ(back.result->scale->sources[0].from_others_sigmas, 3);
  EXPECT_EQ(back.result->information->parameters[0].share[0], 0.25F);
  EXPECT_EQ(back.result->information->groups[0].instant_count, 30u);

  calibration.options.kind = SolveKind::kScale;
  calibration.options.origin.reset();
  ScaleRequest& scale = calibration.options.scale.emplace();
  scale.distances = {{"a", "b", 4, 0.002}};
  scale.lengths = {{0, 2, 1.5, 0.001, "the bar"}};
  scale.leave_out = {"the target"};
  ASSERT_OK_AND_ASSIGN(const Calibration scaled,
                       ParseCalibration(SerializeCalibration(calibration)));
  EXPECT_EQ(scaled.options, calibration.options);
}

TEST(CalibrationWire, RefusesFramesAndScalesThatAreNone) {
  const auto fault = [](const std::function<void(CalibrationOptions*)>& change) {
    CalibrationOptions options;
    options.kind = SolveKind::kOrigin;
    options.parent_id = "c-000001";
    options.origin.emplace();
    options.origin->source = FrameSource::kDown;
    options.origin->down = {0, 1, 0};
    EXPECT_THAT(options.Validate(), IsOk());
    change(&options);
    return FromProto(ToProto(options)).status();
  };
  const auto is = [](const std::string& text) {
    return StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(text));
  };
  EXPECT_THAT(fault([](auto* o) { o->origin.reset(); }), is("origin is not set"));
  EXPECT_THAT(fault([](auto* o) { o->parent_id.clear(); }),
              is("a new origin needs the calibration"));
  EXPECT_THAT(fault([](auto* o) { o->origin->down = {0, 0, 0}; }), is("down is no direction"));
  EXPECT_THAT(fault([](auto* o) { o->frame = FrameChoice::kKeep; }),
              is("frame is for a full solve"));
  EXPECT_THAT(fault([](auto* o) { o->origin->source = FrameSource::kPoints; }),
              is("points is empty"));
  EXPECT_THAT(fault([](auto* o) { o->origin->source = FrameSource::kKept; }),
              is("source is none of"));
  EXPECT_THAT(fault([](auto* o) {
                o->origin->measured.push_back({0, 0, 0, {{"a"}}});
              }),
              is("measured[0] has 1 views"));
  EXPECT_THAT(fault([](auto* o) {
                o->origin->source = FrameSource::kTransform;
                o->origin->rotation_wxyz = {1, 1, 0, 0};
              }),
              is("the length 1.41421"));
  EXPECT_THAT(fault([](auto* o) {
                o->kind = SolveKind::kScale;
                o->origin.reset();
                o->scale.emplace();
              }),
              is("there is no length"));
  EXPECT_THAT(fault([](auto* o) {
                o->kind = SolveKind::kScale;
                o->origin.reset();
                o->scale.emplace().distances.push_back({"a", "a", 1, 2});
              }),
              is("names camera a twice; one sigma of a distance of 1 m is 2 m"));
}

TEST(CalibrationWire, CovarianceIsForTheStoreAlone) {
  Calibration calibration = FilledCalibration();
  calibration.result->camera_covariance = {1e-6, 2e-7, 3e-6};
  calibration.result->wand_volume = WandVolume{{-1, -2, 3}, {1, 2, 5}};
  ASSERT_OK_AND_ASSIGN(const Calibration back, ParseCalibration(SerializeCalibration(calibration)));
  EXPECT_EQ(back.result->camera_covariance, calibration.result->camera_covariance);
  ASSERT_TRUE(back.result->wand_volume.has_value());
  EXPECT_EQ(back.result->wand_volume->min_m, Eigen::Vector3d(-1, -2, 3));
  EXPECT_EQ(back.result->wand_volume->max_m, Eigen::Vector3d(1, 2, 5));
  const v1::Calibration sent = ToProto(back);
  EXPECT_EQ(sent.SerializeAsString().find(std::string("\x8d\xed\xb5\xa0\xf7\xc6\xb0\x3e", 8)),
            std::string::npos)
      << "1e-6 is in what is sent";
  EXPECT_EQ(sent.wand_volume().max_m().z(), 5);
}

TEST(CalibrationWire, ResidualsAreStoredButNotSent) {
  Calibration calibration = FilledCalibration();
  CameraResiduals residuals;
  residuals.camera = "left";
  residuals.image_size_px = {640, 480};
  residuals.vectors = {{1, 2, 0.5, -0.25, false}, {3, 4, 7, 8, true}};
  residuals.bin_px = 0.1;
  residuals.inlier_counts = {1, 0};
  residuals.outlier_counts = {0, 1};
  calibration.result->residuals = {residuals};
  ASSERT_OK_AND_ASSIGN(const Calibration back, ParseCalibration(SerializeCalibration(calibration)));
  ASSERT_EQ(back.result->residuals.size(), 1u);
  EXPECT_EQ(ToProto(back.result->residuals[0]).SerializeAsString(),
            ToProto(residuals).SerializeAsString());
  EXPECT_EQ(back.result->residuals[0].vectors[1].dy_px, 8);
  EXPECT_EQ(ToProto(back).SerializeAsString(), ToProto(FilledCalibration()).SerializeAsString());
}

TEST(CalibrationWire, FailedOneKeepsItsErrorAndRefusals) {
  Calibration calibration = FilledCalibration();
  calibration.state = CalibrationState::kFailed;
  calibration.result.reset();
  calibration.error = "not connected";
  calibration.refused = {{"b", RefusalReason::kCsvEmpty, 1, ""}};
  ASSERT_OK_AND_ASSIGN(const Calibration back, ParseCalibration(SerializeCalibration(calibration)));
  EXPECT_EQ(back.error, "not connected");
  EXPECT_FALSE(back.result.has_value());
  EXPECT_EQ(back.refused, calibration.refused);
}

TEST(CalibrationWire, ACancelledOneOfAnOlderReleaseIsCancelled) {
  Calibration calibration;
  calibration.id = "c-000001";
  // As releases without that state have stored it.
  calibration.state = CalibrationState::kFailed;
  calibration.error = "cancelled";
  ASSERT_OK_AND_ASSIGN(const Calibration read, ParseCalibration(SerializeCalibration(calibration)));
  EXPECT_EQ(read.state, CalibrationState::kCancelled);
  EXPECT_EQ(ToProto(read).state(), v1::Calibration::STATE_CANCELLED);
  calibration.error = "too few instants";
  ASSERT_OK_AND_ASSIGN(const Calibration failed,
                       ParseCalibration(SerializeCalibration(calibration)));
  EXPECT_EQ(failed.state, CalibrationState::kFailed);
}

TEST(CalibrationWire, DamagedBytesAreDataLoss) {
  std::string bytes = SerializeCalibration(FilledCalibration());
  bytes.resize(bytes.size() - 3);
  EXPECT_THAT(ParseCalibration(bytes), StatusIs(absl::StatusCode::kDataLoss, _));
}

TEST(CalibrationWire, JsonHasTheNamesOfTheContract) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  options.always_print_primitive_fields = true;
  std::string json;
  ASSERT_TRUE(
      google::protobuf::util::MessageToJsonString(ToProto(FilledCalibration()), &json, options)
          .ok());
  for (const char* part :
       {"\"state\":\"STATE_SUCCEEDED\"",
        "\"scale_known\":true",
        "\"instant_count\":614",
        "\"image_size_px\":{\"width\":1280,\"height\":1024}",
        "\"cam_from_rig\":{\"rotation\":{\"w\":",
        "\"translation_m\":{\"x\":1",
        "\"model\":\"MODEL_BROWN_CONRADY\"",
        "\"fx_px\":1250",
        "\"distortion\":[-0.2",
        "\"clock_id\":\"clock\"",
        "\"time_offset_s\":-0.00815",
        "\"time_rate_ppm\":0",
        "\"time_epoch_s\":0",
        "\"line_delay_s\":1.5e-05",
        "\"line_delay_sigma_s\":2e-07",
        "\"residuals\":{\"all\":{\"mean_px\":1",
        "\"observation_count\":0",
        "\"outlier_count\":11",
        "\"inlier\":{\"mean_px\":6",
        "\"length_error_rms_m\":0",
        "\"marker_positions_m\":[0,0.1301,0.3902]",
        "\"reason\":\"REFUSAL_REASON_CSV_FIELD_COUNT\",\"count\":3",
        "\"kind\":\"FINDING_KIND_CLOCK_OFFSET\",\"severity\":\"FINDING_SEVERITY_WARNING\"",
        "\"solve_duration\":\"0.250s\""}) {
    EXPECT_THAT(json, HasSubstr(part));
  }
}

TEST(CalibrationWire, UnknownEstimateIsRefused) {
  v1::CalibrationOptions options;
  options.set_intrinsics(static_cast<v1::CalibrationOptions::Estimate>(42));
  EXPECT_THAT(FromProto(options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("options.intrinsics")));
}

TEST(CalibrationWire, AttemptsAreForTheStoreAlone) {
  Calibration calibration = FilledCalibration();
  calibration.attempt_count = 2;
  ASSERT_OK_AND_ASSIGN(const Calibration back, ParseCalibration(SerializeCalibration(calibration)));
  EXPECT_EQ(back.attempt_count, 2u);
  EXPECT_EQ(ToProto(calibration).SerializeAsString(),
            ToProto(FilledCalibration()).SerializeAsString());
}

// The store after a downgrade, or the JSON of a newer server.
TEST(CalibrationWire, WhatALaterVersionHasAddedCostsNoCalibration) {
  const v1::Calibration good = ToProto(FilledCalibration());
  v1::Calibration later = good;
  later.mutable_findings(0)->set_kind(static_cast<v1::FindingKind>(999));
  later.mutable_findings(0)->set_advice("mind the gap");
  later.mutable_findings(0)->set_severity(static_cast<v1::FindingSeverity>(99));
  later.mutable_quality()->set_grade(static_cast<v1::Quality::Grade>(99));
  ASSERT_OK_AND_ASSIGN(const Calibration read, FromProto(later));
  const Finding& finding = read.result->findings.at(0);
  EXPECT_EQ(finding.kind, FindingKind::kUnspecified);
  EXPECT_EQ(finding.unknown_kind, 999);
  EXPECT_EQ(finding.advice, "mind the gap");
  EXPECT_EQ(finding.severity, FindingSeverity::kWarning);
  EXPECT_EQ(read.result->quality.grade, QualityGrade::kNotEvaluated);
  EXPECT_EQ(read.result->cameras.size(), FilledCalibration().result->cameras.size());
  // It goes on as it came.
  EXPECT_EQ(static_cast<int>(ToProto(read).findings(0).kind()), 999);
  ASSERT_OK_AND_ASSIGN(const Calibration stored, ParseCalibration(SerializeCalibration(read)));
  EXPECT_EQ(stored.result->findings.at(0).unknown_kind, 999);
  // In JSON a kind comes by its name, which an older reader has not.
  later.mutable_findings(0)->clear_kind();
  later.mutable_findings(0)->clear_severity();
  EXPECT_THAT(FromProto(later), IsOk());
  later.clear_state();
  EXPECT_THAT(FromProto(later), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("state")));
}

TEST(CalibrationWire, OptionsOfARecordAreNotValidatedAgain) {
  Calibration old = FilledCalibration();
  old.options.sigma_px = -1;
  ASSERT_FALSE(old.options.Validate().ok());
  EXPECT_THAT(FromProto(ToProto(old.options)), StatusIs(absl::StatusCode::kInvalidArgument, _));
  ASSERT_OK_AND_ASSIGN(const Calibration read, ParseCalibration(SerializeCalibration(old)));
  EXPECT_EQ(read.options.sigma_px, -1);
  EXPECT_TRUE(read.result);
  // Values of a later version.
  v1::Calibration later = ToProto(FilledCalibration());
  later.mutable_options()->set_intrinsics(static_cast<v1::CalibrationOptions::Estimate>(42));
  later.mutable_options()->set_kind(static_cast<v1::CalibrationOptions::Kind>(42));
  later.mutable_options()->add_given_intrinsics()->set_camera("without a lens");
  ASSERT_OK_AND_ASSIGN(const Calibration newer, FromProto(later));
  EXPECT_EQ(newer.options.intrinsics, Estimate::kDefault);
  EXPECT_EQ(newer.options.sigma_px, FilledCalibration().options.sigma_px);
  // One that has yet to be solved is not solved in another way than was asked for.
  later.set_state(v1::Calibration::STATE_QUEUED);
  EXPECT_THAT(FromProto(later),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("options.intrinsics")));
}

}  // namespace
}  // namespace rigcal::wire::calibration_wire_test
