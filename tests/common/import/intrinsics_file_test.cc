// SPDX-License-Identifier: Apache-2.0
#include "common/import/intrinsics_file.h"

#include <fstream>
#include <random>
#include <sstream>
#include <string>

#include "tests/testing/recorded_data.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::intrinsics_file_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr char kGood[] = R"(%YAML:1.0
camera_name: someone_else
image_width: 1280
image_height: 1024
camera_matrix: !!opencv-matrix
  rows: 3
  cols: 3
  dt: d
  data: [1255.5, 0, 652, 0, 1253, 506.75, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients: !!opencv-matrix
  rows: 1
  cols: 5
  dt: d
  data: [-0.2228823, 0.2432134, -0.0002509402, 0.00124672, -0.2092471]
extrinsics:
  rows: 3
  cols: 4
  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]
)";

class ReadIntrinsics : public ::testing::Test {
 protected:
  absl::StatusOr<IntrinsicsFile> Read(const std::string& text) const {
    return ReadIntrinsicsFile(folder_.WriteFile("left.yaml", text));
  }
  // The good file with one place changed.
  absl::StatusOr<IntrinsicsFile> ReadWith(const std::string& from, const std::string& to) const {
    std::string text = kGood;
    const size_t at = text.find(from);
    if (at == std::string::npos) return absl::InternalError("the test replaces nothing: " + from);
    text.replace(at, from.size(), to);
    return Read(text);
  }
  void ExpectRefused(const absl::StatusOr<IntrinsicsFile>& result, const std::string& field,
                     const std::string& line) const {
    EXPECT_THAT(result, StatusIs(absl::StatusCode::kInvalidArgument,
                                 AllOf(HasSubstr("left.yaml"), HasSubstr(field), HasSubstr(line))));
  }

  const TemporaryDirectory folder_;
};

TEST_F(ReadIntrinsics, ReadsTheFieldsAndIgnoresNameAndPose) {
  ASSERT_OK_AND_ASSIGN(const IntrinsicsFile file, Read(kGood));
  EXPECT_EQ(file.image_size_px, (ImageSize{1280, 1024}));
  EXPECT_EQ(file.intrinsics,
            (Intrinsics{DistortionModel::kBrownConrady,
                        1255.5,
                        1253,
                        652,
                        506.75,
                        {-0.2228823, 0.2432134, -0.0002509402, 0.00124672, -0.2092471}}));
}

TEST_F(ReadIntrinsics, ReadsTheRecordedCameras) {
  RIGCAL_REQUIRE_RECORDED_DATA(data);
  for (int i = 0; i < 4; ++i) {
    const std::string path = data / "ewand" / ("frame_" + std::to_string(i) + ".yaml");
    ASSERT_OK_AND_ASSIGN(const IntrinsicsFile file, ReadIntrinsicsFile(path));
    EXPECT_EQ(file.image_size_px, (ImageSize{1280, 1024}));
    EXPECT_NEAR(file.intrinsics.fx_px, 1250, 20);
    EXPECT_EQ(file.intrinsics.distortion.size(), 5u);
  }
}

TEST_F(ReadIntrinsics, ReadsMatricesOfWholeNumbersAndPlainMaps) {
  ASSERT_OK_AND_ASSIGN(const IntrinsicsFile whole,
                       ReadWith("[1255.5, 0, 652, 0, 1253, 506.75, 0, 0, 1]",
                                "[1255, 0, 652, 0, 1253, 506, 0, 0, 1]"));
  EXPECT_EQ(whole.intrinsics.fx_px, 1255);
  ASSERT_OK_AND_ASSIGN(const IntrinsicsFile plain,
                       ReadWith("camera_matrix: !!opencv-matrix", "camera_matrix:"));
  EXPECT_EQ(plain.intrinsics.fx_px, 1255.5);
  ASSERT_OK_AND_ASSIGN(const IntrinsicsFile floats, ReadWith("dt: d", "dt: f"));
  EXPECT_EQ(floats.intrinsics.fx_px, 1255.5);
}

TEST_F(ReadIntrinsics, TakesFourCoefficientsAsWithoutK3) {
  std::string text = kGood;
  text.replace(text.find("cols: 5"), 7, "cols: 4");
  text.replace(text.find(", -0.2092471"), 12, "");
  ASSERT_OK_AND_ASSIGN(const IntrinsicsFile file, Read(text));
  EXPECT_EQ(file.intrinsics.model, DistortionModel::kBrownConrady);
  EXPECT_EQ(file.intrinsics.distortion,
            (std::vector<double>{-0.2228823, 0.2432134, -0.0002509402, 0.00124672, 0}));
}

TEST_F(ReadIntrinsics, TellsTheModelFromTheCountWhereNoneIsNamed) {
  ASSERT_OK_AND_ASSIGN(const IntrinsicsFile five, ReadWith("distortion_model: plumb_bob\n", ""));
  EXPECT_EQ(five.intrinsics.model, DistortionModel::kBrownConrady);
  std::string text = kGood;
  text.replace(text.find("distortion_model: plumb_bob\n"), 28, "");
  text.replace(text.find("cols: 5"), 7, "cols: 8");
  text.replace(text.find("-0.2092471]"), 11, "1, 2, 3, 4]");
  ASSERT_OK_AND_ASSIGN(const IntrinsicsFile eight, Read(text));
  EXPECT_EQ(eight.intrinsics.model, DistortionModel::kRational);
  EXPECT_EQ(eight.intrinsics.distortion.size(), 8u);
  EXPECT_EQ(eight.intrinsics.distortion[7], 4);
}

TEST_F(ReadIntrinsics, NamesFileLineAndMissingField) {
  ExpectRefused(ReadWith("image_width: 1280\n", ""), "image_width is missing", "left.yaml");
  ExpectRefused(ReadWith("image_height: 1024\n", ""), "image_height is missing", "left.yaml");
  ExpectRefused(ReadWith("camera_matrix:", "camera_motrix:"), "camera_matrix is missing", "");
  ExpectRefused(ReadWith("distortion_coefficients:", "distortion:"),
                "distortion_coefficients is missing", "");
  ExpectRefused(ReadWith("camera_matrix: !!opencv-matrix\n  rows: 3\n", "camera_matrix:\n"),
                "camera_matrix", "line 5");
  ExpectRefused(ReadWith("  data: [1255.5, 0, 652, 0, 1253, 506.75, 0, 0, 1]\n", ""),
                "camera_matrix", "line 5");
}

TEST_F(ReadIntrinsics, RefusesBadImageSizes) {
  for (const std::string bad : {"0", "-1280", "1e9", "70000", "1280.5", "many", "[1, 2]", ".nan"}) {
    ExpectRefused(ReadWith("image_width: 1280", "image_width: " + bad), "image_width", "line 3");
  }
}

TEST_F(ReadIntrinsics, RefusesBadCameraMatrices) {
  for (const std::string bad :
       {"[.nan, 0, 652, 0, 1253, 506, 0, 0, 1]", "[.Inf, 0, 652, 0, 1253, 506, 0, 0, 1]",
        "[0, 0, 652, 0, 1253, 506, 0, 0, 1]", "[1255, 0, 652, 0, -1253, 506, 0, 0, 1]",
        "[1255, 0, 652, 0, 1253, 506, 0, 0, 2]", "[1255, 3, 652, 0, 1253, 506, 0, 0, 1]",
        "[1255, 0, 0, 0, 1253, 0, 652, 506, 1]", "[1255, 0, 652, 0, 1253, 506, 0, 0]",
        "[1255, 0, 652, 0, 1253, 506, 0, 0, 1, 7]", "[fx, 0, 652, 0, 1253, 506, 0, 0, 1]",
        "[1255, 0, 99999, 0, 1253, 506, 0, 0, 1]", "[[1], 0, 652, 0, 1253, 506, 0, 0, 1]", "5"}) {
    SCOPED_TRACE(bad);
    ExpectRefused(ReadWith("[1255.5, 0, 652, 0, 1253, 506.75, 0, 0, 1]", bad), "camera_matrix",
                  "line 5");
  }
  ExpectRefused(ReadWith("rows: 3\n  cols: 3", "rows: 1\n  cols: 9"), "not 3 x 3", "line 5");
  ExpectRefused(ReadWith("rows: 3", "rows: 2000000000"), "camera_matrix", "line 5");
  ExpectRefused(ReadWith("rows: 3", "rows: -3"), "camera_matrix", "line 5");
}

TEST_F(ReadIntrinsics, RefusesBadDistortion) {
  ExpectRefused(ReadWith("plumb_bob", "thin_prism"), "thin_prism", "line 10");
  ExpectRefused(ReadWith("plumb_bob", "rational_polynomial"), "has 5 values", "line 11");
  ExpectRefused(ReadWith("plumb_bob", "equidistant"), "has 5 values", "line 11");
  ExpectRefused(ReadWith("-0.2228823", ".nan"), "distortion_coefficients", "line 11");
  ExpectRefused(ReadWith("-0.2228823", "k1"), "\"k1\"", "line 11");
  ExpectRefused(ReadWith("cols: 5", "cols: 3"), "distortion_coefficients", "line 11");
}

TEST_F(ReadIntrinsics, NamesTheLineOfASyntaxError) {
  ExpectRefused(ReadWith("image_height: 1024", "\timage_height: 1024"), "", "line 4");
  ExpectRefused(ReadWith("camera_name: someone_else", "no colon here"), "", "line ");
}

TEST_F(ReadIntrinsics, SaysWhenThereIsNoFileOrItIsNotOne) {
  EXPECT_THAT(ReadIntrinsicsFile(folder_.path() / "none.yaml"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("none.yaml")));
  EXPECT_THAT(ReadIntrinsicsFile(folder_.path()),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not a file")));
  EXPECT_THAT(ReadIntrinsicsFile(""), StatusIs(absl::StatusCode::kNotFound, HasSubstr("no such")));
  ExpectRefused(Read(""), "empty", "");
  ExpectRefused(Read("\n \n"), "empty", "");
  ExpectRefused(Read("%YAML:1.0\n"), "no fields", "");
  ExpectRefused(Read("%YAML:1.0\n- 1\n- 2\n"), "no fields", "line 2");
  ExpectRefused(Read("hello world\n"), "no fields", "line 1");
  ExpectRefused(Read("{\"image_width\": 1280}"), "image_height is missing", "");
  ExpectRefused(Read(std::string(5 << 20, ' ')), "larger than", "");
}

TEST_F(ReadIntrinsics, RefusesBinaryAndDeepNesting) {
  ExpectRefused(Read(std::string("%YAML:1.0\nimage_width: 1\0280\n", 28)), "not text", "line 2");
  ExpectRefused(Read("%YAML:1.0\na: " + std::string(100000, '[')), "nested", "line 2");
  ExpectRefused(Read("%YAML:1.0\na: " + std::string(100000, '{')), "nested", "line 2");
  std::string dashes = "%YAML:1.0\na:\n  ";
  for (int i = 0; i < 50000; ++i) dashes += "- ";
  ExpectRefused(Read(dashes), "nested", "line 3");
  // What is in quotes or in a comment closes nothing.
  std::string quoted = "%YAML:1.0\na: ", commented = quoted;
  for (int i = 0; i < 30000; ++i) quoted += "[\"]\",";
  for (int i = 0; i < 30000; ++i) commented += "[ # ]\n ";
  ExpectRefused(Read(quoted), "nested", "line 2");
  ExpectRefused(Read(commented), "nested", "line 64");
}

// OpenCV's own parser never comes back from the first two.
TEST_F(ReadIntrinsics, RefusesSeveralDocumentsAndStraySigns) {
  ExpectRefused(Read("%YAML:1.0\n----c\n----\ni"), "", "line");
  ExpectRefused(Read("%YAML:1.\n ---n:3\n\xc9\n"), "", "");
  ExpectRefused(Read(std::string(kGood) + "---\nimage_width: 5\n"), "second document", "");
}

TEST_F(ReadIntrinsics, TakesCommentsTheDocumentsMarksAndForeignLineEnds) {
  std::string text = kGood;
  text.replace(0, 10, "%YAML:1.0\n---\n# by hand\n\n");
  EXPECT_THAT(Read(text + "...\n"), IsOk());
  std::string windows;
  for (const char c : text) windows += c == '\n' ? "\r\n" : std::string(1, c);
  EXPECT_THAT(Read(windows), IsOk());
  EXPECT_THAT(ReadWith("camera_name: someone_else", "camera_name: \"lumi\xc3\xa8re\""), IsOk());
  EXPECT_THAT(ReadWith("extrinsics:", "views:\n  - 1\n  - 2\nextrinsics:"), IsOk());
  EXPECT_THAT(ReadWith("0, 1253, 506.75,", "0, 1253,\n      506.75,"), IsOk());
}

// A file cut short is refused, or lacks only what is ignored anyway.
TEST_F(ReadIntrinsics, SurvivesBeingCutAtEveryByte) {
  const std::string text = kGood;
  const size_t last_needed = text.find("-0.2092471]") + 11;
  for (size_t length = 0; length < text.size(); ++length) {
    const absl::StatusOr<IntrinsicsFile> file = Read(text.substr(0, length));
    if (length < last_needed) {
      EXPECT_FALSE(file.ok()) << length;
    }
    if (!file.ok()) {
      EXPECT_THAT(file, StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("left.yaml")));
    }
  }
}

TEST_F(ReadIntrinsics, SurvivesDamage) {
  std::mt19937_64 random(7);
  const std::string signs = "[]{}:,-#&*!|>'\"%@\n\t .0129eE+xn\\";
  for (int round = 0; round < 1000; ++round) {
    std::string text = kGood;
    const int changes = 1 + static_cast<int>(random() % 8);
    for (int i = 0; i < changes; ++i) {
      const size_t at = random() % text.size();
      switch (random() % 4) {
        case 0:
          text[at] = signs[random() % signs.size()];
          break;
        case 1:
          text.insert(at, 1, signs[random() % signs.size()]);
          break;
        case 2:
          text.erase(at, 1 + random() % 20);
          break;
        default:
          text[at] = static_cast<char>(random());
      }
      if (text.empty()) break;
    }
    const absl::StatusOr<IntrinsicsFile> file = Read(text);
    if (file.ok()) {
      EXPECT_THAT(file->image_size_px.Validate(), IsOk());
      EXPECT_THAT(file->intrinsics.Validate(file->image_size_px), IsOk());
    } else {
      EXPECT_THAT(file, StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("left.yaml")));
    }
  }
}

}  // namespace
}  // namespace rigcal::intrinsics_file_test
