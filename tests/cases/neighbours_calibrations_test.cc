// SPDX-License-Identifier: Apache-2.0
// Calibrations of other programs, and our own in their formats: no camera is lost without a word,
// and each is taken where a calibration.json is.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/testing/process.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::neighbours_calibrations_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
namespace fs = std::filesystem;

constexpr int kIncomplete = 8;
constexpr char kNoPose[] = "";

// A table of a TOML that anipose, Pose2Sim and caliscope have.
std::string TomlCamera(const std::string& table, const std::string& pose,
                       const std::string& more = "") {
  return "[" + table +
         "]\nsize = [1280, 1024]\n"
         "matrix = [[1000.0, 0.0, 639.5], [0.0, 1000.0, 511.5], [0.0, 0.0, 1.0]]\n"
         "distortions = [-0.1, 0.06, 0.0003, -0.0002]\nfisheye = false\n" +
         pose + more + "\n";
}

std::string Pose(const std::string& translation) {
  return "rotation = [0.0, 0.0, 0.0]\ntranslation = [" + translation + "]\n";
}

class Neighbours : public ::testing::Test {
 protected:
  std::string Path(const std::string& name) const { return (folder_.path() / name).string(); }
  CommandResult Import(const std::string& file, const std::string& text) {
    fs::remove_all(Path("out"));
    folder_.WriteFile(file, text);
    return RunCommand({"rigcal", "calibration", "import", Path(file), "--output", Path("out")});
  }
  std::vector<std::string> Written() const {
    std::vector<std::string> names;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(Path("out"), error)) {
      names.push_back(entry.path().filename().string());
    }
    std::sort(names.begin(), names.end());
    return names;
  }
  const TemporaryDirectory folder_;
};

TEST_F(Neighbours, TomlNamesAreAsTheUserGaveThem) {
  const CommandResult result =
      Import("rig.toml", TomlCamera("int_cam01_img", Pose("0.0, 0.0, 0.0")) +
                             TomlCamera("gopro_top", Pose("-0.5, 0.0, 0.0")) +
                             "[metadata]\nadjusted = false\nerror = 0.0\n");
  EXPECT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(Written(), ::testing::ElementsAre("gopro_top.yaml", "int_cam01_img.yaml"));
}

TEST_F(Neighbours, EveryCameraThatIsLeftOutIsNamed) {
  const std::string good = TomlCamera("cameras.0", Pose("0.0, 0.0, 0.0"));
  for (const std::string& pose :
       {std::string(kNoPose), std::string("rotation = \"null\"\ntranslation = \"null\"\n")}) {
    const CommandResult result = Import("rig.toml", good + TomlCamera("cameras.1", pose));
    EXPECT_EQ(result.exit_code, kIncomplete) << result.error;
    EXPECT_THAT(result.error, AllOf(HasSubstr("cam_1"), HasSubstr("no pose")));
    EXPECT_THAT(Written(), ::testing::ElementsAre("cam_0.yaml"));
  }
  const CommandResult broken = Import(
      "rig.toml", good + TomlCamera("cameras.1", "rotation = [1, 2]\ntranslation = [1, 2]\n"));
  EXPECT_EQ(broken.exit_code, kIncomplete);
  EXPECT_THAT(broken.error, AllOf(HasSubstr("cam_1 is left out"), HasSubstr("rig.toml, line")));
  const CommandResult turned = Import(
      "rig.toml", good + TomlCamera("cameras.1", Pose("1.0, 0.0, 0.0"), "rotation_count = 1\n"));
  EXPECT_EQ(turned.exit_code, kIncomplete);
  EXPECT_THAT(turned.error, AllOf(HasSubstr("cam_1"), HasSubstr("rotation_count = 1")));
}

TEST_F(Neighbours, LensesAloneGiveLenses) {
  const CommandResult result =
      Import("rig.toml", TomlCamera("cameras.0", kNoPose) + TomlCamera("cameras.1", kNoPose));
  EXPECT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(Written(), ::testing::ElementsAre("cam_0.yaml", "cam_1.yaml"));
  const CommandResult colmap = RunCommand({"rigcal", "calibration", "import", Path("rig.toml"),
                                           "--format", "colmap", "--output", Path("out")});
  EXPECT_EQ(colmap.exit_code, 1);
  EXPECT_THAT(colmap.error, HasSubstr("lens alone"));
}

TEST_F(Neighbours, AGapInKalibrsChainCostsWhatHangsOnIt) {
  const auto camera = [](int number, bool chained) {
    return "cam" + std::to_string(number) +
           ":\n  camera_model: pinhole\n  distortion_coeffs: [0, 0, 0, 0]\n"
           "  distortion_model: radtan\n  intrinsics: [1000, 1000, 639.5, 511.5]\n"
           "  resolution: [1280, 1024]\n" +
           (chained ? "  T_cn_cnm1:\n  - [1, 0, 0, -0.5]\n  - [0, 1, 0, 0]\n  - [0, 0, 1, 0]\n"
                      "  - [0, 0, 0, 1]\n"
                    : "");
  };
  const CommandResult result =
      Import("chain.yaml", camera(0, false) + camera(1, true) + camera(3, true) + camera(4, true));
  EXPECT_EQ(result.exit_code, kIncomplete) << result.error;
  EXPECT_THAT(Written(), ::testing::ElementsAre("cam0.yaml", "cam1.yaml"));
  EXPECT_THAT(result.error, AllOf(HasSubstr("cam2"), HasSubstr("cam3"), HasSubstr("cam4")));
}

// A point that wanders before two cameras, half a metre apart.
class NeighboursPoints : public Neighbours {
 protected:
  static constexpr int kRows = 40;
  NeighboursPoints() {
    const auto camera = [](const std::string& name, const std::string& translation) {
      return "[" + name +
             "]\nsize = [1280, 1024]\n"
             "matrix = [[1000.0, 0.0, 639.5], [0.0, 1000.0, 511.5], [0.0, 0.0, 1.0]]\n"
             "distortions = [0.0, 0.0, 0.0, 0.0]\n" +
             Pose(translation) + "\n";
    };
    folder_.WriteFile("rig.toml",
                      camera("left", "0.0, 0.0, 0.0") + camera("right", "-0.5, 0.0, 0.0"));
    fs::create_directory(Path("rows"));
    for (const double base : {0.0, 0.5}) {
      std::ofstream file(Path(base == 0 ? "rows/left.csv" : "rows/right.csv"));
      for (int i = 0; i < kRows; ++i) {
        const double x = 0.1 + 0.01 * i, y = 0.005 * (i % 7), z = 2 + 0.02 * i;
        file << i * 40'000'000LL << ";" << 1000 * (x - base) / z + 639.5 << ";"
             << 1000 * y / z + 511.5 << "\n";
      }
    }
  }
  // Lines of the file of points, without the header.
  int Triangulated(const std::string& calibration) {
    const CommandResult result =
        RunCommand({"rigcal", "triangulate", calibration, "--data", Path("rows"), "--output", "-"});
    EXPECT_EQ(result.exit_code, 0) << result.error;
    std::istringstream lines(result.output);
    int count = -1;
    for (std::string line; std::getline(lines, line);) ++count;
    return count;
  }
};

TEST_F(NeighboursPoints, AreTriangulatedWithAFileOfAnotherProgram) {
  EXPECT_EQ(Triangulated(Path("rig.toml")), kRows);
  const CommandResult lines =
      RunCommand({"rigcal", "triangulate", Path("rig.toml"), "--data", "-", "--output", "-"});
  EXPECT_EQ(lines.exit_code, 1);
  EXPECT_THAT(lines.error, HasSubstr("--data DIR"));
}

TEST_F(NeighboursPoints, OriginAndScaleTakeAFileOfAnotherProgram) {
  const CommandResult origin = RunCommand({"rigcal", "calibration", "origin", Path("rig.toml"),
                                           "--down", "0,1,0", "--output", Path("down.json")});
  ASSERT_EQ(origin.exit_code, 0) << origin.error;
  EXPECT_EQ(Triangulated(Path("down.json")), kRows);
  const CommandResult scale =
      RunCommand({"rigcal", "calibration", "scale", Path("rig.toml"), "--distance",
                  "left,right,0.51", "--output", Path("scaled.json")});
  ASSERT_EQ(scale.exit_code, 0) << scale.error;
  EXPECT_EQ(Triangulated(Path("scaled.json")), kRows);
}

// FreeMoCap writes millimetres into the fields in which others have metres.
TEST_F(Neighbours, MillimetresAreNotTakenForMetres) {
  const std::string text =
      TomlCamera("cam_0", Pose("0.0, 0.0, 0.0")) + TomlCamera("cam_1", Pose("-4213.0, 0.0, 0.0"));
  const CommandResult doubted = Import("rig.toml", text);
  EXPECT_EQ(doubted.exit_code, kIncomplete) << doubted.error;
  EXPECT_THAT(doubted.error, AllOf(HasSubstr("cam_0 and cam_1 are 4213.0 m apart"),
                                   HasSubstr("4.213 m"), HasSubstr("--units mm")));
  for (const auto& [unit, x_m] : {std::pair("mm", -4.213), {"m", -4213.0}}) {
    const CommandResult said =
        RunCommand({"rigcal", "calibration", "import", Path("rig.toml"), "--units", unit,
                    "--format", "json", "--force", "--output", Path("said")});
    EXPECT_EQ(said.exit_code, 0) << said.error;
    EXPECT_EQ(said.error, "");
    std::ifstream file(Path("said/calibration.json"));
    const auto json = nlohmann::json::parse(file);
    EXPECT_NEAR(json["cameras"][1]["cam_from_rig"]["translation_m"]["x"].get<double>(), x_m, 1e-9);
  }
  // Whatever else reads a rig says it, too.
  const CommandResult triangulated =
      RunCommand({"rigcal", "triangulate", Path("rig.toml"), "--data", folder_.path().string(),
                  "--output", Path("points.csv")});
  EXPECT_THAT(triangulated.error, HasSubstr("--units mm"));
}

// Every format that import reads holds the same rig.
TEST_F(NeighboursPoints, OurOwnExportsAreReadBack) {
  for (const char* format : {"opencv", "json", "kalibr", "ros", "colmap", "colmap-binary",
                             "nerfstudio", "anipose", "pose2sim", "caliscope", "openmvg"}) {
    SCOPED_TRACE(format);
    const std::string out = Path(std::string("as-") + format);
    const CommandResult written = RunCommand(
        {"rigcal", "calibration", "import", Path("rig.toml"), "--format", format, "--output", out});
    ASSERT_EQ(written.exit_code, 0) << written.error;
    EXPECT_EQ(Triangulated(out), kRows);
    const CommandResult again = RunCommand(
        {"rigcal", "calibration", "import", out, "--format", "json", "--output", out + "-back"});
    EXPECT_EQ(again.exit_code, 0) << again.error;
    std::ifstream file(out + "-back/calibration.json");
    const auto json = nlohmann::json::parse(file);
    ASSERT_EQ(json["cameras"].size(), 2u);
    EXPECT_EQ(json["cameras"][1]["camera"], "right");
    EXPECT_NEAR(json["cameras"][1]["cam_from_rig"]["translation_m"]["x"].get<double>(), -0.5, 1e-9);
    EXPECT_NEAR(json["cameras"][1]["intrinsics"]["cx_px"].get<double>(), 639.5, 1e-9);
  }
}

// Lenses that a format cannot say are refitted within the error that is asked for.
TEST_F(Neighbours, ExportsRefitALensWithinAStatedError) {
  std::string camera = TomlCamera("left", Pose("0.0, 0.0, 0.0"));
  camera.replace(camera.find("-0.0002]"), 8, "-0.0002, 0.02]");
  folder_.WriteFile("rig.toml", camera);
  const auto written_as = [&](const char* format, const char* most) {
    return RunCommand({"rigcal", "calibration", "import", Path("rig.toml"), "--format", format,
                       "--output", Path("out"), "--max-error-px", most, "-o", "json"});
  };
  const CommandResult kalibr = written_as("kalibr", "0.5");
  ASSERT_EQ(kalibr.exit_code, 0) << kalibr.error;
  const double error_px = nlohmann::json::parse(kalibr.output)["lens_error_px"]["left"];
  EXPECT_GT(error_px, 0);
  EXPECT_LE(error_px, 0.5);
  std::ifstream file(Path("out/camchain.yaml"));
  std::ostringstream text;
  text << file.rdbuf();
  EXPECT_THAT(text.str(), HasSubstr("# the lens is refitted: up to 0."));
  EXPECT_EQ(written_as("kalibr", "0").exit_code, 1);
  const CommandResult usd = written_as("usd", "0.5");
  EXPECT_EQ(usd.exit_code, 1);
  EXPECT_THAT(usd.error, AllOf(HasSubstr("wrong by up to"), HasSubstr("--undistorted")));
  EXPECT_EQ(written_as("usd", "99").exit_code, 0);
}

}  // namespace
}  // namespace rigcal::testing::neighbours_calibrations_test
