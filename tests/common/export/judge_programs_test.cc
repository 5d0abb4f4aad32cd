// SPDX-License-Identifier: Apache-2.0
// Exports judged by the programs themselves, where they are installed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iomanip>
#include <random>
#include <sstream>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/camera/camera_model.h"
#include "common/export/calibration_export.h"
#include "common/wire/camera_wire.h"
#include "tests/common/export/exported_rigs.h"
#include "tests/testing/process.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::judge_programs_test {
namespace {

using ::rigcal::testing::CalibrationOfLens;
using ::rigcal::testing::CommandResult;
using ::rigcal::testing::RunCommand;
using ::rigcal::testing::TemporaryDirectory;
using ::rigcal::testing::TestLens;

std::string PathOfProgram(const std::string& name) {
  for (const std::string folder : {"/usr/bin/", "/usr/local/bin/"}) {
    if (std::filesystem::exists(folder + name)) return folder + name;
  }
  return "";
}

std::string JudgeScript(const char* name) {
  return absl::StrCat(RIGCAL_SOURCE_DIR, "/tests/common/export/judges/", name);
}

// Writes the files of the export and 1 000 points for each camera, and returns where we see them.
std::vector<Eigen::Vector2d> WriteForJudge(const v1::Calibration& calibration, const char* format,
                                           const TemporaryDirectory& directory) {
  const auto files = (*FindCalibrationExportFormat(format))->make(calibration);
  EXPECT_THAT(files, testing::IsOk());
  if (!files.ok()) return {};
  for (const ExportFile& file : *files) directory.WriteFile(file.name, file.content);
  std::ostringstream points;
  points << std::setprecision(17);
  std::vector<Eigen::Vector2d> pixels;
  std::mt19937 random(11);
  std::uniform_real_distribution<double> share(0, 1), distance_m(0.5, 10);
  for (const v1::CalibratedCamera& camera : calibration.cameras()) {
    const Intrinsics intrinsics = *wire::FromProto(camera.intrinsics());
    const RigidTransform rig_from_cam = wire::FromProto(camera.cam_from_rig())->Inverse();
    for (int i = 0; i < 1000; ++i) {
      const Eigen::Vector2d pixel(share(random) * camera.image_size_px().width() - 0.5,
                                  share(random) * camera.image_size_px().height() - 0.5);
      const auto ray = Undistort(intrinsics, pixel);
      EXPECT_THAT(ray, testing::IsOk());
      if (!ray.ok()) return {};
      const Eigen::Vector3d x =
          rig_from_cam * Eigen::Vector3d(distance_m(random) * ray->homogeneous().normalized());
      points << camera.camera() << " " << x.x() << " " << x.y() << " " << x.z() << "\n";
      pixels.push_back(pixel);
    }
  }
  directory.WriteFile("points.txt", points.str());
  return pixels;
}

// Lines "SEEN NAME u v", in the order of the points.
void ExpectSeen(const CommandResult& result, const std::vector<Eigen::Vector2d>& pixels) {
  ASSERT_EQ(result.exit_code, 0) << result.error;
  size_t seen = 0;
  double worst_px = 0;
  for (const absl::string_view line : absl::StrSplit(result.output, '\n')) {
    const std::vector<std::string> words = absl::StrSplit(line, ' ');
    if (words.size() != 4 || words[0] != "SEEN") continue;
    Eigen::Vector2d pixel(1e9, 1e9);
    ASSERT_TRUE(absl::SimpleAtod(words[2], &pixel.x()) && absl::SimpleAtod(words[3], &pixel.y()));
    ASSERT_LT(seen, pixels.size());
    const double error_px = (pixel - pixels[seen++]).norm();
    if (!(error_px <= worst_px)) worst_px = error_px;
  }
  EXPECT_EQ(seen, pixels.size()) << result.output.substr(0, 2000) << result.error.substr(0, 2000);
  EXPECT_LT(worst_px, 0.01);
}

TEST(JudgePrograms, BlenderSeesWhatWeSee) {
  const std::string blender = PathOfProgram("blender");
  if (blender.empty()) GTEST_SKIP() << "Blender is not installed (Debian: blender)";
  const TemporaryDirectory directory;
  const auto pixels = WriteForJudge(CalibrationOfLens(TestLens::kPinhole, {"left", "right", "top"}),
                                    "blender", directory);
  const CommandResult result =
      RunCommand({blender, "-b", "--factory-startup", "--python", JudgeScript("blender_judge.py"),
                  "--", directory.path().string()});
  ExpectSeen(result, pixels);
}

TEST(JudgePrograms, SciPyReadsTheMatFile) {
  const std::string python = PathOfProgram("python3");
  if (python.empty() || RunCommand({python, "-c", "import scipy.io, cv2"}).exit_code != 0) {
    GTEST_SKIP() << "SciPy and OpenCV for Python are not installed (Debian: python3-scipy, "
                    "python3-opencv)";
  }
  for (const TestLens lens :
       {TestLens::kPinhole, TestLens::kBrown5, TestLens::kRational, TestLens::kFisheye}) {
    SCOPED_TRACE(static_cast<int>(lens));
    const TemporaryDirectory directory;
    const auto pixels =
        WriteForJudge(CalibrationOfLens(lens, {"left", "right", "top"}), "matlab", directory);
    ExpectSeen(RunCommand({python, JudgeScript("scipy_judge.py"), directory.path().string()}),
               pixels);
  }
}

// The numbers of a line of COLMAP's text, and its words.
std::vector<std::string> ColmapLines(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) {
    if (!line.empty() && line[0] != '#') lines.push_back(line);
  }
  std::sort(lines.begin(), lines.end());
  return lines;
}

void ExpectSameNumbers(const std::vector<std::string>& a, const std::vector<std::string>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    const std::vector<std::string> words_a = absl::StrSplit(a[i], ' ');
    const std::vector<std::string> words_b = absl::StrSplit(b[i], ' ');
    ASSERT_EQ(words_a.size(), words_b.size()) << a[i] << "\n" << b[i];
    for (size_t k = 0; k < words_a.size(); ++k) {
      double number_a = 0, number_b = 0;
      if (absl::SimpleAtod(words_a[k], &number_a) && absl::SimpleAtod(words_b[k], &number_b)) {
        EXPECT_NEAR(number_a, number_b, 1e-9 * (1 + std::abs(number_a)));
      } else {
        EXPECT_EQ(words_a[k], words_b[k]);
      }
    }
  }
}

// COLMAP reads both models, and writes the same.
TEST(JudgePrograms, ColmapReadsTextAndBinary) {
  const std::string colmap = PathOfProgram("colmap");
  if (colmap.empty()) GTEST_SKIP() << "COLMAP is not installed (Debian: colmap)";
  for (const TestLens lens :
       {TestLens::kPinhole, TestLens::kBrown4, TestLens::kRational, TestLens::kFisheye}) {
    SCOPED_TRACE(static_cast<int>(lens));
    const TemporaryDirectory text, binary, out_text, out_binary;
    const v1::Calibration calibration = CalibrationOfLens(lens, {"left", "right", "top"});
    WriteForJudge(calibration, "colmap", text);
    WriteForJudge(calibration, "colmap-binary", binary);
    for (const auto& [in, out] : {std::pair(&text, &out_text), std::pair(&binary, &out_binary)}) {
      const CommandResult result =
          RunCommand({colmap, "model_converter", "--input_path", in->path().string(),
                      "--output_path", out->path().string(), "--output_type", "TXT"},
                     {{"QT_QPA_PLATFORM", "offscreen"}});
      ASSERT_EQ(result.exit_code, 0) << result.output << result.error;
    }
    for (const char* file : {"cameras.txt", "images.txt"}) {
      const std::vector<std::string> ours = ColmapLines(text.path() / file);
      EXPECT_EQ(ours.size(), 3u);
      ExpectSameNumbers(ours, ColmapLines(out_text.path() / file));
      ExpectSameNumbers(ours, ColmapLines(out_binary.path() / file));
    }
  }
}

// A COLMAP model of the exported cameras, with points that two images of each camera see where we
// say: COLMAP's own reprojection error is the judgement.
TEST(JudgePrograms, ColmapProjectsAsWeDo) {
  const std::string colmap = PathOfProgram("colmap");
  if (colmap.empty()) GTEST_SKIP() << "COLMAP is not installed (Debian: colmap)";
  for (const TestLens lens : {TestLens::kPinhole, TestLens::kBrown4, TestLens::kBrown5,
                              TestLens::kRational, TestLens::kFisheye}) {
    SCOPED_TRACE(static_cast<int>(lens));
    const TemporaryDirectory directory, out;
    const auto pixels =
        WriteForJudge(CalibrationOfLens(lens, {"left", "right", "top"}), "colmap", directory);
    const std::vector<std::string> heads = ColmapLines(directory.path() / "images.txt");
    std::ifstream points(directory.path() / "points.txt");
    std::ostringstream images, tracks;
    images << std::setprecision(17);
    ASSERT_EQ(heads.size() * 1000, pixels.size());
    for (size_t camera = 0; camera < heads.size(); ++camera) {
      std::ostringstream seen;
      seen << std::setprecision(17);
      for (size_t i = 0; i < 1000; ++i) {
        const size_t id = camera * 1000 + i + 1;
        std::string name, x, y, z;
        points >> name >> x >> y >> z;
        // The centre of the first pixel is (0.5, 0.5) there.
        seen << pixels[id - 1].x() + 0.5 << " " << pixels[id - 1].y() + 0.5 << " " << id << " ";
        tracks << id << " " << x << " " << y << " " << z << " 0 0 0 0 " << camera + 1 << " " << i
               << " " << camera + 11 << " " << i << "\n";
      }
      const std::vector<std::string> words = absl::StrSplit(heads[camera], absl::MaxSplits(' ', 1));
      images << heads[camera] << "\n" << seen.str() << "\n";
      images << camera + 11 << " " << words[1] << ".again\n" << seen.str() << "\n";
    }
    directory.WriteFile("images.txt", images.str());
    directory.WriteFile("points3D.txt", tracks.str());
    const CommandResult result = RunCommand(
        {colmap, "bundle_adjuster", "--input_path", directory.path().string(), "--output_path",
         out.path().string(), "--BundleAdjustment.max_num_iterations", "1",
         "--BundleAdjustment.refine_focal_length", "0", "--BundleAdjustment.refine_extra_params",
         "0", "--BundleAdjustment.refine_extrinsics", "0"},
        {{"QT_QPA_PLATFORM", "offscreen"}});
    ASSERT_EQ(result.exit_code, 0) << result.error;
    const std::string text = result.output + result.error, field = "Initial cost : ";
    ASSERT_THAT(text, ::testing::HasSubstr(field));
    EXPECT_LT(std::stod(text.substr(text.find(field) + field.size())), 0.01);  // px
  }
}

}  // namespace
}  // namespace rigcal::judge_programs_test
