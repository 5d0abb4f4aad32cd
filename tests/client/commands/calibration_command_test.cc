// SPDX-License-Identifier: Apache-2.0
// `rigcal calibrate`, `rigcal calibration` and `rigcal doctor` against a server in this process.
#include "client/commands/calibration_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "common/wire/protocol_version.h"
#include "tests/client/command_runner.h"
#include "tests/client/fake_server.h"
#include "tests/client/sample_messages.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::client::calibration_command_test {
namespace {

using nlohmann::json;
using ::rigcal::testing::CommandOutcome;
using ::rigcal::testing::FakeServer;
using ::rigcal::testing::FullCalibration;
using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class CalibrationCommand : public ::testing::Test {
 protected:
  CommandOutcome Rigcal(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(), {"--server", fake_.address()});
    return rigcal::testing::Rigcal(arguments);
  }

  FakeServer fake_;
};

TEST_F(CalibrationCommand, CalibrateSendsEveryOption) {
  const CommandOutcome outcome = Rigcal({"calibrate", "a",
                                         "b",         "--reference-camera",
                                         "left",      "--intrinsics",
                                         "fixed",     "--time-offsets",
                                         "refined",   "--marker-positions",
                                         "auto",      "--sigma-px",
                                         "0.5",       "--association-tolerance-ms",
                                         "2.5",       "--seed",
                                         "7",         "--trajectory",
                                         "spline",    "-o",
                                         "json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const v1::CreateCalibrationRequest& request = fake_.created_calibration;
  EXPECT_THAT(request.session_ids(), ElementsAre("a", "b"));
  const v1::CalibrationOptions& options = request.options();
  EXPECT_EQ(options.reference_camera(), "left");
  EXPECT_EQ(options.intrinsics(), v1::CalibrationOptions::ESTIMATE_FIXED);
  EXPECT_EQ(options.time_offsets(), v1::CalibrationOptions::ESTIMATE_REFINED);
  EXPECT_EQ(options.marker_positions(), v1::CalibrationOptions::ESTIMATE_AUTO);
  EXPECT_EQ(options.sigma_px(), 0.5);
  EXPECT_EQ(options.association_tolerance_s(), 0.0025);
  EXPECT_EQ(options.seed(), 7u);
  EXPECT_EQ(options.trajectory(), v1::CalibrationOptions::TRAJECTORY_SPLINE);
  // Without --wait it is only queued.
  EXPECT_EQ(json::parse(outcome.out).at("state"), "STATE_QUEUED");
}

TEST_F(CalibrationCommand, CalibrateSendsAKnownDistance) {
  const CommandOutcome outcome = Rigcal({"calibrate", "a", "--distance", "left,right,1.25,0.001"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const v1::KnownDistance& known = fake_.created_calibration.options().known_distance();
  EXPECT_EQ(known.camera_a(), "left");
  EXPECT_EQ(known.camera_b(), "right");
  EXPECT_EQ(known.distance_m(), 1.25);
  EXPECT_EQ(known.sigma_m(), 0.001);
}

TEST_F(CalibrationCommand, CalibrateLeavesTheDefaultsToTheServer) {
  ASSERT_EQ(Rigcal({"calibrate", "a"}).exit_code, 0);
  const v1::CalibrationOptions& options = fake_.created_calibration.options();
  EXPECT_EQ(options.intrinsics(), v1::CalibrationOptions::ESTIMATE_UNSPECIFIED);
  EXPECT_EQ(options.association_tolerance_s(), 0);
}

TEST_F(CalibrationCommand, CalibrateWaitsForTheResult) {
  fake_.calibrations["cal-new"] = FullCalibration("cal-new");
  fake_.calibrations["cal-new"].set_state(v1::Calibration::STATE_RUNNING);
  int asked = 0;
  fake_.on_get_calibration = [&](v1::Calibration& calibration) {
    if (++asked == 3) calibration.set_state(v1::Calibration::STATE_SUCCEEDED);
  };
  const CommandOutcome outcome = Rigcal({"calibrate", "a", "--wait"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(asked, 3);
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("succeeded"), HasSubstr("instants used")));
  // What a person does next.
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("rigcal rig activate cal-new"),
                                 HasSubstr("rigcal calibration export cal-new")));
}

TEST_F(CalibrationCommand, CalibrateFollowsTheStreamOfTheServer) {
  v1::Calibration running = FullCalibration("cal-new");
  running.set_state(v1::Calibration::STATE_RUNNING);
  running.mutable_progress()->set_stage(v1::CALIBRATION_STAGE_ADJUSTING);
  fake_.calibration_watches.push_back({{running, FullCalibration("cal-new")}, grpc::Status::OK});
  fake_.failures["GetCalibration"] = grpc::Status(grpc::StatusCode::INTERNAL, "not asked");
  const CommandOutcome outcome = Rigcal({"calibrate", "a", "--wait"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("succeeded"));
}

TEST_F(CalibrationCommand, CalibrateAsksAgainWhereTheStreamBreaks) {
  v1::Calibration running = FullCalibration("cal-new");
  running.set_state(v1::Calibration::STATE_RUNNING);
  fake_.calibration_watches.push_back(
      {{running}, grpc::Status(grpc::StatusCode::UNAVAILABLE, "the server is shutting down")});
  fake_.calibrations["cal-new"] = FullCalibration("cal-new");
  const CommandOutcome outcome = Rigcal({"calibrate", "a", "--wait"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("succeeded"));
}

TEST_F(CalibrationCommand, CalibrateEndsWhenTheCalibrationIsDeleted) {
  v1::Calibration running = FullCalibration("cal-new");
  running.set_state(v1::Calibration::STATE_RUNNING);
  fake_.calibration_watches.push_back(
      {{running}, grpc::Status(grpc::StatusCode::NOT_FOUND, "no calibration cal-new")});
  const CommandOutcome outcome = Rigcal({"calibrate", "a", "--wait"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("no calibration cal-new"));
}

TEST_F(CalibrationCommand, CalibrateThatFailsSaysWhyAndExitsWithOne) {
  v1::Calibration failed = FullCalibration("cal-new");
  failed.set_state(v1::Calibration::STATE_FAILED);
  failed.set_error("cameras {left} and {right} share no instants");
  fake_.calibrations["cal-new"] = failed;
  const CommandOutcome table = Rigcal({"calibrate", "a", "--wait"});
  EXPECT_EQ(table.exit_code, 1);
  EXPECT_THAT(table.err, HasSubstr("share no instants"));
  EXPECT_THAT(table.out, HasSubstr("clock_epoch_without_offset"));
  const CommandOutcome as_json = Rigcal({"calibrate", "a", "--wait", "-o", "json"});
  EXPECT_EQ(as_json.exit_code, 1);
  EXPECT_EQ(json::parse(as_json.out).at("state"), "STATE_FAILED");
}

TEST_F(CalibrationCommand, CalibrateBelowTheQualityGateExitsWithThree) {
  fake_.calibrations["cal-new"] = FullCalibration("cal-new");
  fake_.calibrations["cal-new"].mutable_quality()->set_grade(v1::Quality::GRADE_BAD);
  const CommandOutcome outcome = Rigcal({"calibrate", "a", "--wait", "-o", "json"});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_EQ(json::parse(outcome.out).at("quality").at("grade"), "GRADE_BAD");
  // Looking at it later is no failure.
  EXPECT_EQ(Rigcal({"calibration", "get", "cal-new"}).exit_code, 0);
}

TEST_F(CalibrationCommand, CalibrateNamesTheSessionThatDoesNotExist) {
  fake_.failures["CreateCalibration"] =
      grpc::Status(grpc::StatusCode::NOT_FOUND, "there is no session nobody");
  const CommandOutcome outcome = Rigcal({"calibrate", "nobody", "--wait"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("nobody"));
  EXPECT_THAT(outcome.out, IsEmpty());
}

TEST_F(CalibrationCommand, GetAndListPrint) {
  fake_.calibrations["cal-1"] = FullCalibration("cal-1");
  EXPECT_THAT(Rigcal({"calibration", "get", "cal-1"}).out, HasSubstr("Reprojection errors"));
  EXPECT_EQ(json::parse(Rigcal({"calibration", "get", "cal-1", "-o", "json"}).out).at("id"),
            "cal-1");
  EXPECT_THAT(Rigcal({"calibration", "list"}).out, HasSubstr("\ncal-1 "));
  for (const char* id : {"cal-2", "cal-3"}) fake_.calibrations[id] = FullCalibration(id);
  fake_.page_size = 1;
  const json list = json::parse(Rigcal({"calibration", "list", "-o", "json"}).out);
  EXPECT_EQ(list.at("calibrations").size(), 3u);
}

TEST_F(CalibrationCommand, ListSendsFilterAndOrder) {
  EXPECT_EQ(Rigcal({"calibration", "list", "--rig", "lab", "--session", "wave", "--filter",
                    "state=STATE_FAILED", "--order-by", "id desc"})
                .exit_code,
            0);
  EXPECT_EQ(fake_.listed_calibrations.filter(),
            "rig=\"lab\" AND session_ids:\"wave\" AND state=STATE_FAILED");
  EXPECT_EQ(fake_.listed_calibrations.order_by(), "id desc");
}

TEST_F(CalibrationCommand, DeleteRemovesOne) {
  fake_.calibrations["cal-1"] = FullCalibration("cal-1");
  const CommandOutcome deleted = Rigcal({"calibration", "delete", "cal-1", "--yes"});
  EXPECT_EQ(deleted.exit_code, 0) << deleted.err;
  EXPECT_EQ(deleted.out, "calibration cal-1 is deleted\n");
  const CommandOutcome again = Rigcal({"calibration", "delete", "cal-1", "--yes"});
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.err, HasSubstr("cal-1"));
}

TEST_F(CalibrationCommand, CancelShowsTheEnd) {
  fake_.calibrations["cal-1"] = FullCalibration("cal-1");
  EXPECT_THAT(Rigcal({"calibration", "cancel", "cal-1"}).out, HasSubstr("cancelled"));
  EXPECT_EQ(Rigcal({"calibration", "cancel", "cal-9"}).exit_code, 1);
}

TEST_F(CalibrationCommand, ExportWritesFilesAndNamesThem) {
  const rigcal::testing::TemporaryDirectory directory;
  const std::string folder = (directory.path() / "out").string();
  fake_.calibrations["cal-1"] = FullCalibration("cal-1");
  const CommandOutcome opencv =
      Rigcal({"calibration", "export", "cal-1", "--format", "opencv", "--output", folder});
  EXPECT_EQ(opencv.exit_code, 0) << opencv.err;
  EXPECT_EQ(opencv.out, folder + "/left.yaml\n" + folder + "/right.yaml\n");
  EXPECT_TRUE(std::filesystem::exists(folder + "/left.yaml"));
  const CommandOutcome as_json = Rigcal(
      {"calibration", "export", "cal-1", "--format", "json", "--output", folder, "-o", "json"});
  EXPECT_EQ(json::parse(as_json.out),
            json({{"calibration", "cal-1"}, {"files", {folder + "/calibration.json"}}}));
}

TEST_F(CalibrationCommand, ExportToStdoutIsTheCalibration) {
  fake_.calibrations["cal-1"] = FullCalibration("cal-1");
  const CommandOutcome outcome =
      Rigcal({"calibration", "export", "cal-1", "--format", "json", "--output", "-"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(json::parse(outcome.out).at("instant_count"), 614);
  fake_.calibrations["cal-1"].set_state(v1::Calibration::STATE_RUNNING);
  EXPECT_EQ(
      Rigcal({"calibration", "export", "cal-1", "--format", "json", "--output", "-"}).exit_code, 1);
}

TEST_F(CalibrationCommand, CompareOfEqualOnesIsZero) {
  fake_.calibrations["cal-1"] = FullCalibration("cal-1");
  fake_.calibrations["cal-2"] = FullCalibration("cal-2");
  const CommandOutcome table = Rigcal({"calibration", "compare", "cal-1", "cal-2"});
  EXPECT_EQ(table.exit_code, 0) << table.err;
  EXPECT_THAT(table.out, ContainsRegex("left +0.000 +0.0000 +0.000 +0.500 +0.500\n"));
  const json as_json =
      json::parse(Rigcal({"calibration", "compare", "cal-1", "cal-2", "-o", "json"}).out);
  EXPECT_LT(as_json.at("max_position_difference_m"), 1e-9);
  EXPECT_EQ(as_json.at("same_observations"), true);
  EXPECT_EQ(Rigcal({"calibration", "compare", "cal-1", "cal-9"}).exit_code, 1);
}

TEST_F(CalibrationCommand, ComparesWithAFileAndConvertsIt) {
  const rigcal::testing::TemporaryDirectory directory;
  const std::string folder = directory.path().string();
  fake_.calibrations["cal-1"] = FullCalibration("cal-1");
  for (const char* format : {"ros", "caliscope"}) {
    EXPECT_EQ(Rigcal({"calibration", "export", "cal-1", "--format", format, "--output", folder})
                  .exit_code,
              0);
  }
  const std::string file = folder + "/camera_array.toml";
  const CommandOutcome table = Rigcal({"calibration", "compare", "cal-1", file});
  EXPECT_EQ(table.exit_code, 0) << table.err;
  EXPECT_THAT(table.out, ContainsRegex("left +0.000 +0.0000 +- +0.500 +-\n"));
  const CommandOutcome imported =
      Rigcal({"calibration", "import", file, "--output", folder + "/yaml"});
  EXPECT_EQ(imported.exit_code, 0) << imported.err;
  EXPECT_EQ(imported.out, folder + "/yaml/left.yaml\n" + folder + "/yaml/right.yaml\n");
  EXPECT_EQ(Rigcal({"calibration", "compare", file, folder + "/yaml"}).exit_code, 0);
  const CommandOutcome none = Rigcal({"calibration", "compare", "cal-1", folder + "/none.xcp"});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_THAT(none.err, HasSubstr("none.xcp: no such file"));
}

TEST_F(CalibrationCommand, ExportsForUndistortedImages) {
  const rigcal::testing::TemporaryDirectory directory;
  const std::string folder = directory.path().string();
  v1::Calibration calibration = FullCalibration("cal-1");
  v1::Intrinsics* const lens = calibration.mutable_cameras(0)->mutable_intrinsics();
  ASSERT_GT(lens->distortion_size(), 0);
  lens->set_distortion(0, -0.2);
  fake_.calibrations["cal-1"] = calibration;
  std::vector<std::string> arguments = {"calibration", "export",   "cal-1", "--format",
                                        "usd",         "--output", folder};
  const CommandOutcome refused = Rigcal(arguments);
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, HasSubstr("--undistorted"));
  arguments.push_back("--undistorted");
  EXPECT_EQ(Rigcal(arguments).exit_code, 0);
  EXPECT_TRUE(std::filesystem::exists(folder + "/rig.usda"));
}

TEST_F(CalibrationCommand, ResidualsAreATableOfCameras) {
  fake_.calibrations["c-1"] = FullCalibration("c-1");
  v1::CameraResiduals* const left = fake_.residuals.add_cameras();
  left->set_camera("left");
  left->set_bin_px(0.25);
  for (const uint32_t count : {10u, 80u, 9u, 1u}) left->add_inlier_counts(count);
  for (const uint32_t count : {0u, 0u, 0u, 3u}) left->add_outlier_counts(count);
  for (const bool outlier : {false, false, true}) {
    left->add_outlier(outlier);
    left->add_dx_px(outlier ? 90.0F : 0.2F);
    left->add_dy_px(outlier ? 90.0F : -0.1F);
  }
  const CommandOutcome outcome = Rigcal({"calibration", "residuals", "c-1", "--camera", "left"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(fake_.asked_residuals.camera(), "left");
  EXPECT_THAT(outcome.out,
              ContainsRegex("left +100 +3 +0.250 +0.125 +0.750 +0.200 +-0.100 +\\|@.\\| +1.00"));
  const json as_json = json::parse(Rigcal({"calibration", "residuals", "c-1", "-o", "json"}).out);
  EXPECT_EQ(as_json.at("cameras").at(0).at("inlier_counts").at(1), 80);
  EXPECT_EQ(Rigcal({"calibration", "residuals", "c-404"}).exit_code, 1);
}

TEST_F(CalibrationCommand, DoctorOfAHealthyServerIsOk) {
  fake_.status.set_software_version(std::string(wire::kSoftwareVersion));
  *fake_.status.mutable_protocol_version() = wire::OwnProtocolVersion();
  fake_.status.mutable_store()->set_free_bytes(uint64_t{100} << 30);
  const CommandOutcome table = Rigcal({"doctor"});
  EXPECT_EQ(table.exit_code, 0) << table.out;
  EXPECT_THAT(table.out, AllOf(ContainsRegex("ok +server +reachable"), HasSubstr("serving"),
                               ContainsRegex("warn +agents"), Not(HasSubstr("fail"))));
  const json as_json = json::parse(Rigcal({"doctor", "-o", "json"}).out);
  EXPECT_EQ(as_json.at("ok"), true);
  EXPECT_EQ(as_json.at("checks").at(0).at("level"), "ok");
}

TEST_F(CalibrationCommand, DoctorFailsWithOneWhereACheckFails) {
  fake_.status.set_software_version(std::string(wire::kSoftwareVersion));
  *fake_.status.mutable_protocol_version() = wire::OwnProtocolVersion();
  fake_.status.mutable_store()->set_free_bytes(uint64_t{100} << 30);
  fake_.SetServing(false);
  const CommandOutcome outcome = Rigcal({"doctor"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.out, ContainsRegex("fail +health +the server says NOT_SERVING"));
  fake_.SetServing(true);
  fake_.failures["ListSessions"] = grpc::Status(grpc::StatusCode::INTERNAL, "store is broken");
  EXPECT_THAT(Rigcal({"doctor"}).out, ContainsRegex("fail +sessions +store is broken"));
}

}  // namespace
}  // namespace rigcal::client::calibration_command_test
