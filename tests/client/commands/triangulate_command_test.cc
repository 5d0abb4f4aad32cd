// SPDX-License-Identifier: Apache-2.0
// `rigcal triangulate`, `calibration origin` and `calibration scale` on files, without a server.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "client/results/calibration_file.h"
#include "common/board/board.h"
#include "common/camera/camera_model.h"
#include "tests/client/command_runner.h"
#include "tests/client/results/c3d_reader.h"
#include "tests/client/results/parquet_reader.h"
#include "tests/common/triangulate/true_result.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::client::triangulate_command_test {
namespace {

using ::rigcal::testing::CommandOutcome;
using ::rigcal::testing::Rigcal;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;

std::string RowText(const Observation& row) {
  std::string line = absl::StrCat(row.time_ns);
  for (const MarkerObservation& marker : row.markers) {
    if (!marker.visible) {
      absl::StrAppend(&line, ";-1;-1");
    } else {
      absl::StrAppendFormat(&line, ";%.9f;%.9f", marker.centre_px.x(), marker.centre_px.y());
    }
  }
  return line + "\n";
}

class TriangulateCommand : public ::testing::Test {
 protected:
  TriangulateCommand() {
    SimulationOptions simulation;
    simulation.camera_count = 4;
    simulation.duration_s = 4;
    simulation.outlier_share = 0;
    Target wand;
    wand.marker_positions_m = {0, 0.13, 0.39};
    world_ = *SimulatedWorld::Create(simulation, wand);
    CalibrationResult result = rigcal::testing::TrueResult(*world_);
    result.target.marker_positions_m = wand.marker_positions_m;
    result.target.scale_sigma_rel = 0.001;
    CalibrationFile file;
    file.calibration.set_id("c-000001");
    file.calibration.set_state(v1::Calibration::STATE_SUCCEEDED);
    SetResult(result, &file);
    calibration_ = folder_.WriteFile("calibration.json", CalibrationText(file)).string();
  }

  // As a recorded folder.
  std::string WriteRows(const std::string& name, const std::vector<CameraRows>& rows) {
    const std::filesystem::path folder = folder_.path() / name;
    std::filesystem::create_directories(folder);
    for (const CameraRows& camera : rows) {
      std::ofstream file(folder / (camera.camera + ".csv"));
      for (const Observation& row : camera.rows) file << RowText(row);
    }
    return folder.string();
  }

  // The wand at rest at each of these places for a second.
  std::vector<CameraRows> AtRest(const std::vector<WandPose>& places) {
    std::vector<CameraRows> rows;
    for (int c = 0; c < 4; ++c) {
      CameraRows& camera = rows.emplace_back();
      camera.camera = absl::StrCat("sim_", c);
      int frame = 0;
      for (const WandPose& place : places) {
        for (int i = 0; i < 25; ++i) camera.rows.push_back(world_->ObserveWand(c, frame++, place));
      }
    }
    return rows;
  }

  std::string Path(const char* name) const { return (folder_.path() / name).string(); }

  TemporaryDirectory folder_;
  std::optional<SimulatedWorld> world_;
  std::string calibration_;
};

TEST_F(TriangulateCommand, WritesPointsThatEvaluateReads) {
  const std::string rows = WriteRows("rows", rigcal::testing::RowsOf(*world_));
  const CommandOutcome outcome =
      Rigcal({"triangulate", calibration_, "--data", rows, "--output", Path("points.csv")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("points at"), HasSubstr("130.00"),
                                 HasSubstr("no covariance of the calibration")));
  std::ostringstream truth;
  truth << "time_s,label,x_m,y_m,z_m\n";
  for (int i = 0; i < 400; ++i) {
    for (size_t marker = 0; marker < 3; ++marker) {
      const Eigen::Vector3d at = world_->MarkerAt(world_->WandAt(0.01 * i), marker);
      truth << absl::StrFormat("%.3f,%d,%.9f,%.9f,%.9f\n", 0.01 * i, marker, at.x(), at.y(),
                               at.z());
    }
  }
  const std::string truth_file = folder_.WriteFile("truth.csv", truth.str()).string();
  const auto json = nlohmann::json::parse(Rigcal({"evaluate", Path("points.csv"), "--ground-truth",
                                                  truth_file, "--keep-time", "-o", "json"})
                                              .out);
  EXPECT_GT(json.at("count").get<int>(), 200);
  EXPECT_LT(json.at("total_rmse_m").get<double>(), 0.003);
}

TEST_F(TriangulateCommand, RowsThatShareNoMomentAreAnErrorInEveryFormat) {
  std::vector<CameraRows> apart = rigcal::testing::RowsOf(*world_);
  for (size_t c = 0; c < apart.size(); ++c) {
    for (Observation& row : apart[c].rows) {
      row.time_ns += static_cast<int64_t>(c) * 100'000'000'000;
    }
  }
  std::vector<CameraRows> unseen = rigcal::testing::RowsOf(*world_);
  for (CameraRows& camera : unseen) {
    for (Observation& row : camera.rows) {
      for (MarkerObservation& marker : row.markers) marker.visible = false;
    }
  }
  const std::string far = WriteRows("apart", apart), nothing = WriteRows("unseen", unseen);
  for (const char* const file : {"none.csv", "none.parquet", "none.trc", "none.c3d"}) {
    const CommandOutcome outcome =
        Rigcal({"triangulate", calibration_, "--data", far, "--output", Path(file)});
    EXPECT_NE(outcome.exit_code, 0);
    EXPECT_THAT(outcome.err, AllOf(HasSubstr("seen by two cameras at one moment"),
                                   HasSubstr("sim_1 from 100.")));
    EXPECT_FALSE(std::filesystem::exists(Path(file)));
    EXPECT_THAT(
        Rigcal({"triangulate", calibration_, "--data", nothing, "--output", Path(file)}).err,
        HasSubstr("sim_1 no marker"));
  }
}

TEST_F(TriangulateCommand, TheEndingOfTheOutputIsKnownWhateverItsCase) {
  const std::string rows = WriteRows("rows", rigcal::testing::RowsOf(*world_));
  const CommandOutcome refused =
      Rigcal({"triangulate", calibration_, "--data", rows, "--output", Path("points.xlsx")});
  EXPECT_NE(refused.exit_code, 0);
  EXPECT_THAT(refused.err, HasSubstr(".csv, .parquet, .trc or .c3d, not as .xlsx"));
  ASSERT_EQ(
      Rigcal({"triangulate", calibration_, "--data", rows, "--output", Path("P.TRC")}).exit_code,
      0);
  std::ifstream trc(Path("P.TRC"));
  std::string line;
  std::getline(trc, line);
  EXPECT_THAT(line, HasSubstr("PathFileType"));
}

TEST_F(TriangulateCommand, WritesTheSamePointsAsParquet) {
  const std::string rows = WriteRows("rows", rigcal::testing::RowsOf(*world_));
  const auto write = [&](const char* file) {
    const CommandOutcome outcome =
        Rigcal({"triangulate", calibration_, "--data", rows, "--output", Path(file)});
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  };
  write("points.csv");
  write("points.parquet");
  std::ifstream bytes(Path("points.parquet"), std::ios::binary);
  const rigcal::testing::ParquetTable table =
      rigcal::testing::ReadParquet(std::string(std::istreambuf_iterator<char>(bytes), {}));
  EXPECT_EQ(table.notes.at("calibration"), "calibration.json");
  std::ifstream csv(Path("points.csv"));
  std::string line;
  std::getline(csv, line);
  std::vector<std::string> names = table.names;
  ASSERT_EQ(names.front(), "time_ns");
  names.front() = "time_s";
  EXPECT_EQ(line, absl::StrJoin(names, ","));
  size_t count = 0;
  for (; std::getline(csv, line); ++count) {
    const std::vector<std::string> fields = absl::StrSplit(line, ',');
    const double time_s =
        1e-9 * static_cast<double>(std::get<std::vector<int64_t>>(table.columns[0]).at(count));
    EXPECT_NEAR(std::stod(fields[0]), time_s, 1e-6);
    EXPECT_EQ(fields[1], std::get<std::vector<std::string>>(table.columns[1])[count]);
    for (size_t c = 2; c < fields.size(); ++c) {
      const double value = c == 11 ? std::get<std::vector<int32_t>>(table.columns[c])[count]
                                   : std::get<std::vector<double>>(table.columns[c])[count];
      // As the text is rounded: 7 decimals of metres, 3 of pixels, 3 digits of sigmas.
      const double rounded = c < 5 ? 5.1e-8 : c == 12 ? 5.1e-4 : 5.1e-3 * std::abs(value);
      EXPECT_NEAR(std::stod(fields[c]), value, rounded) << names[c];
    }
  }
  EXPECT_GT(count, 200u);
  EXPECT_EQ(table.row_count, static_cast<int64_t>(count));
}

TEST_F(TriangulateCommand, WritesTheSamePointsForProgramsOfMotionCapture) {
  const std::string rows = WriteRows("rows", rigcal::testing::RowsOf(*world_));
  std::map<std::string, std::string> files;
  for (const char* file : {"points.csv", "points.trc", "points.c3d"}) {
    const CommandOutcome outcome =
        Rigcal({"triangulate", calibration_, "--data", rows, "--output", Path(file)});
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    std::ifstream bytes(Path(file), std::ios::binary);
    files[file] = std::string(std::istreambuf_iterator<char>(bytes), {});
  }
  const rigcal::testing::C3dContent c3d = rigcal::testing::ReadC3d(files["points.c3d"]);
  EXPECT_NEAR(c3d.rate_hz, 25, 1e-3);
  EXPECT_THAT(c3d.parameters.at("RIGCAL:CALIBRATION").Texts(),
              ::testing::ElementsAre("calibration.json"));  // and no folder of this PC
  const double first_s = 1e-9 * std::stod(c3d.parameters.at("RIGCAL:FIRST_TIME_NS").Texts().at(0));
  const std::vector<std::string> trc = absl::StrSplit(files["points.trc"], '\n');
  ASSERT_EQ(trc.size(), 7 + c3d.frames.size());
  int count = 0;
  const std::vector<std::string> lines = absl::StrSplit(files["points.csv"], '\n');
  for (size_t i = 1; i + 1 < lines.size(); ++i, ++count) {
    const std::vector<std::string> fields = absl::StrSplit(lines[i], ',');
    const auto frame =
        static_cast<size_t>(std::lround((std::stod(fields[0]) - first_s) * c3d.rate_hz));
    const size_t marker = std::stoul(fields[1]);
    const std::vector<std::string> columns = absl::StrSplit(trc.at(6 + frame), '\t');
    EXPECT_GT(c3d.frames.at(frame).at(marker).word, 0);
    for (size_t axis = 0; axis < 3; ++axis) {
      const double at_mm = 1000 * std::stod(fields[2 + axis]);
      EXPECT_NEAR(std::stod(columns.at(2 + 3 * marker + axis)), at_mm, 6e-5);
      EXPECT_NEAR(static_cast<double>(c3d.frames[frame][marker].position[axis]), at_mm, 1e-3);
    }
  }
  EXPECT_GT(count, 200);
}

TEST_F(TriangulateCommand, NamesWhatIsMissing) {
  EXPECT_THAT(Rigcal({"triangulate", "./none.json", "--data", ".", "--output", "-"}).err,
              HasSubstr("none.json"));
  EXPECT_THAT(Rigcal({"triangulate", calibration_, "--data", Path("none"), "--output", "-"}).err,
              HasSubstr("no folder"));
  std::vector<CameraRows> rows = rigcal::testing::RowsOf(*world_);
  rows.resize(2);
  rows[1].camera = "left";
  EXPECT_THAT(
      Rigcal({"triangulate", calibration_, "--data", WriteRows("two", rows), "--output", "-"}).err,
      AllOf(HasSubstr("and of others (left)"), HasSubstr("a point needs two")));
}

TEST_F(TriangulateCommand, OriginPutsTheFloorUnderTheWand) {
  const std::string rows =
      WriteRows("floor", AtRest({{Eigen::Vector3d(0.4, 0.2, 0.9), Eigen::Vector3d::UnitX()},
                                 {Eigen::Vector3d(-0.5, 0.3, 0.9), Eigen::Vector3d::UnitY()}}));
  const CommandOutcome outcome = Rigcal({"calibration", "origin", calibration_, "--floor", rows,
                                         "--height", "0.02", "--output", Path("floor.json")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("marker 2 at place 2"));
  const auto moved = ReadCalibration(Path("floor.json"));
  ASSERT_THAT(moved, rigcal::testing::IsOk());
  const auto result = ResultOf(*moved);
  ASSERT_THAT(result, rigcal::testing::IsOk());
  for (size_t c = 0; c < 4; ++c) {
    const double height_m = result->cameras[c].cam_from_rig.SourceFromTargetTranslation().z();
    const double in_world_m = world_->cameras()[c].cam_from_rig.SourceFromTargetTranslation().z();
    EXPECT_NEAR(height_m, in_world_m - 0.88, 0.01);
  }
  EXPECT_EQ(Rigcal({"calibration", "compare", calibration_, Path("floor.json")}).exit_code, 0);
}

// A board that lies on a table, print up. Rows whose points are counted as in a mirror put the
// cameras below the table, and no residual shows it: points in a plane have no handedness.
TEST_F(TriangulateCommand, OriginPutsTheTableUnderAPrintedBoard) {
  const Board board = *ParseBoard("board:checker,9x6,0.04");
  constexpr double kTableM = 0.7;
  const auto rows_of = [&](bool mirrored) {
    std::vector<CameraRows> rows;
    for (int c = 0; c < 4; ++c) {
      CameraRows& camera = rows.emplace_back();
      camera.camera = absl::StrCat("sim_", c);
      for (int i = 0; i < 25; ++i) {
        Observation row;
        row.time_ns = 40'000'000 * i;
        for (int r = 0; r < board.rows; ++r) {
          for (int k = 0; k < board.columns; ++k) {
            const int column = mirrored ? board.columns - 1 - k : k;
            // Of a print that lies face up, rows go towards -y.
            const Eigen::Vector3d in_world(0.04 * column - 0.1, -0.04 * r + 0.1, kTableM);
            MarkerObservation& marker = row.markers.emplace_back();
            const SimulatedCamera& of = world_->cameras()[static_cast<size_t>(c)];
            marker.visible =
                Project(of.true_intrinsics, of.cam_from_rig * in_world, &marker.centre_px);
          }
        }
        camera.rows.push_back(row);
      }
    }
    return rows;
  };
  const auto origin = [&](const char* folder, bool mirrored) {
    return Rigcal({"calibration", "origin", calibration_, "--board", "board:checker,9x6,0.04",
                   "--data", WriteRows(folder, rows_of(mirrored)), "--output", Path("table.json")});
  };
  EXPECT_THAT(origin("mirrored", true).err, HasSubstr("mirror"));
  const CommandOutcome outcome = origin("table", false);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto moved = ReadCalibration(Path("table.json"));
  ASSERT_THAT(moved, rigcal::testing::IsOk());
  const auto result = ResultOf(*moved);
  ASSERT_THAT(result, rigcal::testing::IsOk());
  for (size_t c = 0; c < 4; ++c) {
    const Eigen::Vector3d at_m = result->cameras[c].cam_from_rig.SourceFromTargetTranslation();
    const Eigen::Vector3d in_world_m =
        world_->cameras()[c].cam_from_rig.SourceFromTargetTranslation();
    EXPECT_LT((at_m - in_world_m + Eigen::Vector3d(-0.1, 0.1, kTableM)).norm(), 0.001);
  }
}

TEST_F(TriangulateCommand, OriginNeedsExactlyOneWay) {
  EXPECT_EQ(Rigcal({"calibration", "origin", calibration_, "--board", "board:checker,9x6,0.04",
                    "--output", "x.json"})
                .exit_code,
            2);
  EXPECT_EQ(Rigcal({"calibration", "origin", calibration_, "--output", "x.json"}).exit_code, 2);
}

TEST_F(TriangulateCommand, ScaleNamesTheSourceThatIsOffAndWritesNothing) {
  const std::string rows = WriteRows("bar", rigcal::testing::RowsOf(*world_));
  const double distance_m = (world_->cameras()[0].cam_from_rig.SourceFromTargetTranslation() -
                             world_->cameras()[1].cam_from_rig.SourceFromTargetTranslation())
                                .norm();
  const auto scale = [&](double bar_m) {
    return Rigcal({"calibration", "scale", calibration_, "--distance",
                   absl::StrFormat("sim_0,sim_1,%.6f", distance_m), "--length",
                   absl::StrFormat("0,2,%.6f,0.0002", bar_m), "--data", rows, "--output",
                   Path("scaled.json")});
  };
  const CommandOutcome wrong = scale(0.39 * 1.03);
  EXPECT_EQ(wrong.exit_code, 1);
  EXPECT_THAT(wrong.err, AllOf(HasSubstr("disagrees: \"length 0 to 2\" is"), HasSubstr("longer"),
                               HasSubstr("nothing was written")));
  EXPECT_FALSE(std::filesystem::exists(Path("scaled.json")));
  const CommandOutcome right = scale(0.39);
  EXPECT_EQ(right.exit_code, 0) << right.err;
  EXPECT_THAT(right.out, HasSubstr("every length"));
  EXPECT_TRUE(std::filesystem::exists(Path("scaled.json")));
}

}  // namespace
}  // namespace rigcal::client::triangulate_command_test
