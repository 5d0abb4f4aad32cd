// SPDX-License-Identifier: Apache-2.0
#include "client/commands/lens_command.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/file/durable_file.h"
#include "tests/client/command_runner.h"
#include "tests/client/fake_server.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::client::lens_command_test {
namespace {

using ::rigcal::testing::CommandOutcome;
using ::rigcal::testing::Rigcal;
using ::testing::AllOf;
using ::testing::HasSubstr;

std::string Yaml(double focal_px, double cx_px, double k1, int width = 640) {
  return "%YAML:1.0\n---\nimage_width: " + std::to_string(width) +
         "\nimage_height: 480\n"
         "camera_matrix: !!opencv-matrix\n  rows: 3\n  cols: 3\n  dt: d\n  data: [" +
         std::to_string(focal_px) + ", 0, " + std::to_string(cx_px) + ", 0, " +
         std::to_string(focal_px) +
         ", 240, 0, 0, 1]\n"
         "distortion_coefficients: !!opencv-matrix\n  rows: 1\n  cols: 5\n  dt: d\n  data: [" +
         std::to_string(k1) + ", 0, 0, 0, 0]\n";
}

TEST(LensCommand, SaysHowFarTwoLensesAreApart) {
  const rigcal::testing::TemporaryDirectory folder;
  const auto a = folder.WriteFile("a.yaml", Yaml(500, 320, -0.1));
  const auto same = folder.WriteFile("same.yaml", Yaml(500, 320, -0.1));
  const auto shifted = folder.WriteFile("shifted.yaml", Yaml(500, 321, -0.1));
  const auto other = folder.WriteFile("other.yaml", Yaml(500, 320, -0.12));
  const auto median = [&](const std::string& b) {
    const CommandOutcome outcome = Rigcal({"lens", "diff", a, b, "-o", "json"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return nlohmann::json::parse(outcome.out)["median_px"].get<double>();
  };
  EXPECT_LT(median(same), 1e-6);
  // A principal point that is a pixel off is a turn of 0.11 degrees and little else.
  EXPECT_LT(median(shifted), 0.3);
  EXPECT_GT(median(other), 0.1);
  const CommandOutcome text = Rigcal({"lens", "diff", a, shifted});
  EXPECT_THAT(text.out, HasSubstr("after a turn of 0.1"));
}

TEST(LensCommand, RefusesWhatCannotBeCompared) {
  const rigcal::testing::TemporaryDirectory folder;
  const auto a = folder.WriteFile("a.yaml", Yaml(500, 320, -0.1));
  const auto large = folder.WriteFile("large.yaml", Yaml(500, 320, -0.1, 1280));
  const CommandOutcome sizes = Rigcal({"lens", "diff", a, large});
  EXPECT_EQ(sizes.exit_code, 1);
  EXPECT_THAT(sizes.err, HasSubstr("1280 x 480"));
  const CommandOutcome none = Rigcal({"lens", "diff", a, (folder.path() / "no.yaml").string()});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_THAT(none.err, HasSubstr("no.yaml: no such calibration file"));
}

class ServedLens : public ::testing::Test {
 protected:
  ServedLens() {
    v1::Lens& lens = fake_.lenses["left"];
    lens.set_session_id("s-1");
    lens.set_camera("left");
    lens.set_board("board:checker,9x6,0.025");
    lens.set_state(v1::Lens::STATE_SOLVING);
    lens.set_stored_count(90);
    lens.set_observation_count(60);
    lens.mutable_image_size_px()->set_width(640);
    fake_.on_get_lens = [this](v1::Lens& asked) {
      ++asked_;
      Proceed(asked);
    };
    v1::Session& session = fake_.sessions["s-1"];
    session.set_id("s-1");
    for (const char* camera : {"left", "right"}) {
      v1::CameraDescription& description = *session.add_cameras()->mutable_description();
      description.set_camera(camera);
      if (camera == std::string("right")) description.mutable_intrinsics()->set_fx_px(900);
    }
  }
  // The first lens is made from what was stored a while ago, the third one from everything.
  void Proceed(v1::Lens& lens) const {
    if (asked_ < 2) return;
    lens.set_state(end_);
    lens.set_problem(problem_);
    if (end_ != v1::Lens::STATE_SOLVED) {
      lens.set_observation_count(90);
      return;
    }
    v1::LensResult& result = *lens.mutable_result();
    result.set_observation_count(asked_ < 3 ? 60 : 90);
    result.set_model("pinhole5");
    result.set_held_out_rms_px(asked_ < 3 ? 0.9 : 0.118);
    result.mutable_intrinsics()->set_fx_px(1100);
    result.set_opencv_yaml("%YAML:1.0\n---\ncamera_name: left\n");
    lens.mutable_next_pose()->set_words("near, in the upper left corner");
  }
  CommandOutcome Lens(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "lens");
    arguments.insert(arguments.end(), {"--server", fake_.address()});
    return Rigcal(arguments);
  }

  rigcal::testing::FakeServer fake_;
  rigcal::testing::TemporaryDirectory folder_;
  int asked_ = 0;
  v1::Lens::State end_ = v1::Lens::STATE_SOLVED;
  std::string problem_;
};

TEST_F(ServedLens, IsWrittenOnceItIsOfEverythingThatIsStored) {
  const std::string file = (folder_.path() / "left.yaml").string();
  const CommandOutcome outcome = Lens({"get", "s-1", "left", "--output", file});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(asked_, 3);
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("pinhole5"), HasSubstr("0.118 px in views"),
                                 HasSubstr("next view     near, in the upper left corner")));
  EXPECT_EQ(*ReadSmallFile(file), "%YAML:1.0\n---\ncamera_name: left\n");
  // It is not replaced unless that is meant.
  EXPECT_THAT(Lens({"get", "s-1", "left", "--output", file}).err, HasSubstr("--force"));
  EXPECT_EQ(asked_, 3);
}

TEST_F(ServedLens, SaysWhyThereIsNone) {
  end_ = v1::Lens::STATE_COLLECTING;
  problem_ = "there are 3 views that differ";
  const CommandOutcome few = Lens({"get", "s-1", "left"});
  EXPECT_EQ(few.exit_code, 1);
  EXPECT_THAT(few.err, HasSubstr("no lens of camera left: there are 3 views that differ"));
  EXPECT_THAT(Lens({"get", "s-1", "top"}).err, HasSubstr("no camera 'top'"));
}

TEST_F(ServedLens, IsUsedForTheCamerasThatHaveNone) {
  fake_.calibrations["cal-new"].set_id("cal-new");
  fake_.calibrations["cal-new"].set_state(v1::Calibration::STATE_SUCCEEDED);
  const CommandOutcome outcome = Lens({"use", "s-1"});
  EXPECT_THAT(outcome.err, HasSubstr("camera left: pinhole5, 0.118 px"));
  const v1::CreateCalibrationRequest& asked = fake_.created_calibration;
  ASSERT_EQ(asked.session_ids_size(), 1) << outcome.err;
  EXPECT_EQ(asked.session_ids(0), "s-1");
  ASSERT_EQ(asked.options().given_intrinsics_size(), 1);
  EXPECT_EQ(asked.options().given_intrinsics(0).camera(), "left");
  EXPECT_EQ(asked.options().given_intrinsics(0).image_size_px().width(), 640u);
  EXPECT_EQ(asked.options().given_intrinsics(0).intrinsics().fx_px(), 1100);
}

}  // namespace
}  // namespace rigcal::client::lens_command_test
