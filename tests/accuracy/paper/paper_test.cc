// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/paper/paper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "tests/accuracy/paper/film_camera.h"
#include "tests/accuracy/paper/index_paired_solve.h"
#include "tests/accuracy/paper/paper_plot.h"
#include "tests/accuracy/paper/paper_recording.h"
#include "tests/accuracy/paper/paper_report.h"
#include "tests/accuracy/paper/paper_run.h"
#include "tests/accuracy/paper/paper_scene.h"
#include "tests/accuracy/paper/spline_solve.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::accuracy::paper_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::internal::CaptureStderr;
using ::testing::internal::CaptureStdout;
using ::testing::internal::GetCapturedStderr;
using ::testing::internal::GetCapturedStdout;

constexpr double kMeanOfRayleigh = 1.2533;  // of sigma 1: the square root of pi / 2

PaperOptions Short() {
  PaperOptions options;
  options.points = true;
  options.recording.duration_s = 10;
  options.recording.path_s = 6;
  options.recording.board_rate_hz = 4;
  options.recording.board_turn_s = 8;
  options.seeds = 1;
  return options;
}

const PaperRow* RowOf(const std::vector<PaperRow>& rows, const std::string& name) {
  const auto found =
      std::ranges::find_if(rows, [&name](const PaperRow& row) { return NameOf(row) == name; });
  return found == rows.end() ? nullptr : &*found;
}

// By view of the trigger, how many cameras see the target.
std::vector<int> CamerasThatSee(const PaperRecording& recording) {
  std::vector<int> counts(recording.input.tracks.front().observations.size(), 0);
  for (const server::CameraTrack& track : recording.input.tracks) {
    for (size_t i = 0; i < counts.size(); ++i) {
      counts[i] += track.observations[i].VisibleCount() > 0 ? 1 : 0;
    }
  }
  return counts;
}

TEST(PaperRecording, HasThePapersCameras) {
  ASSERT_OK_AND_ASSIGN(const PaperRecording recording,
                       RecordPaper(Short().recording, PaperTarget::kWand));
  ASSERT_THAT(recording.input.tracks, SizeIs(kPaperCameras));
  for (int c = 0; c < kPaperCameras; ++c) {
    const server::CameraTrack& track = recording.input.tracks[static_cast<size_t>(c)];
    const bool event = c >= kPaperFrameCameras;
    EXPECT_EQ(track.camera.sensor, event ? SensorKind::kEvent : SensorKind::kFrame);
    EXPECT_EQ(track.camera.image_size_px.width, 1280u);
    EXPECT_EQ(track.camera.image_size_px.height, event ? 720u : 1024u);
    for (const Observation& row : track.observations) {
      for (const MarkerObservation& marker : row.markers) {
        if (!marker.visible) continue;
        EXPECT_GT(marker.centre_px.y(), -1);
        EXPECT_LT(marker.centre_px.y(), track.camera.image_size_px.height);
      }
    }
  }
}

TEST(PaperRecording, BoardIsSeenFromOneSide) {
  PaperRecordingOptions options = Short().recording;
  ASSERT_OK_AND_ASSIGN(const PaperRecording one_side, RecordPaper(options, PaperTarget::kCircles));
  options.board_angle_deg = 180;
  ASSERT_OK_AND_ASSIGN(const PaperRecording both, RecordPaper(options, PaperTarget::kCircles));
  const std::vector<int> seen = CamerasThatSee(one_side), seen_from_both = CamerasThatSee(both);
  // The cameras stand all around: less than three quarters of them are on one side.
  EXPECT_GT(std::ranges::max(seen), 1);
  EXPECT_LT(std::ranges::max(seen), 5);
  EXPECT_GE(std::ranges::max(seen_from_both), 5);
}

// The same motion is seen: only the points are elsewhere.
TEST(PaperRecording, PointsOfABoardAreOffAsAsked) {
  PaperRecordingOptions options = Short().recording;
  ASSERT_OK_AND_ASSIGN(const PaperRecording exact, RecordPaper(options, PaperTarget::kChecker));
  options.board_sigma_m = 0.002;
  ASSERT_OK_AND_ASSIGN(const PaperRecording off, RecordPaper(options, PaperTarget::kChecker));
  EXPECT_EQ(off.input.target, exact.input.target);
  double squares_px2 = 0;
  int count = 0;
  const std::vector<Observation>& rows = off.input.tracks.front().observations;
  for (size_t i = 0; i < rows.size(); ++i) {
    const Observation& other = exact.input.tracks.front().observations[i];
    for (size_t m = 0; m < rows[i].markers.size(); ++m) {
      if (!rows[i].markers[m].visible || !other.markers[m].visible) continue;
      squares_px2 += (rows[i].markers[m].centre_px - other.markers[m].centre_px).squaredNorm();
      ++count;
    }
  }
  ASSERT_GT(count, 200);
  // Of 1250 px, seen from 2 to 6 m; a board that is tilted shows less of one direction.
  const double rms_px = std::sqrt(squares_px2 / (2 * count));
  EXPECT_GT(rms_px, 0.002 * 1250 / 6 * 0.7);
  EXPECT_LT(rms_px, 0.002 * 1250 / 2);
}

TEST(PaperRecording, RefusesOptionsThatMakeNoWorld) {
  PaperRecordingOptions options = Short().recording;
  options.duration_s = -1;
  EXPECT_THAT(RecordPaper(options, PaperTarget::kWand),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("duration")));
}

TEST(PaperRecording, LeavesOutACameraThatSeesTheBoardTooSeldom) {
  PaperRecordingOptions options = Short().recording;
  options.board_angle_deg = 12;
  ASSERT_OK_AND_ASSIGN(const PaperRecording recording, RecordPaper(options, PaperTarget::kChecker));
  ASSERT_THAT(recording.views, SizeIs(kPaperCameras));
  for (const auto& [camera, views] : recording.views) {
    const bool takes_part = std::ranges::any_of(
        recording.input.tracks,
        [&](const server::CameraTrack& track) { return track.camera.camera == camera; });
    EXPECT_EQ(takes_part, views >= kPaperLeastViews) << camera;
  }
  EXPECT_LT(recording.input.tracks.size(), size_t{kPaperCameras});
}

TEST(IndexPairedSolve, RefusesBoardsAndRowsThatShareNothing) {
  ASSERT_OK_AND_ASSIGN(const PaperRecording board,
                       RecordPaper(Short().recording, PaperTarget::kCircles));
  EXPECT_THAT(SolveIndexPaired(board.input),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("wand")));
  ASSERT_OK_AND_ASSIGN(PaperRecording wand, RecordPaper(Short().recording, PaperTarget::kWand));
  server::CalibrationInput no_lens = wand.input;
  no_lens.tracks[1].camera.intrinsics.reset();
  EXPECT_THAT(SolveIndexPaired(no_lens),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("frame_1")));
  for (server::CameraTrack& track : wand.input.tracks) track.observations.resize(5);
  EXPECT_THAT(SolveIndexPaired(wand.input),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("fewer than 10")));
}

TEST(SplineSolve, RefusesWandsAndBoardsThatNoTwoCamerasSee) {
  ASSERT_OK_AND_ASSIGN(const PaperRecording wand,
                       RecordPaper(Short().recording, PaperTarget::kWand));
  EXPECT_THAT(SolveSpline(wand.input),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("rigid")));
  ASSERT_OK_AND_ASSIGN(PaperRecording board, RecordPaper(Short().recording, PaperTarget::kChecker));
  board.input.tracks.resize(1);
  EXPECT_THAT(SolveSpline(board.input),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("0 times")));
  board.input.tracks.clear();
  EXPECT_THAT(SolveSpline(board.input),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("rigid")));
}

TEST(SplineSolve, FindsRigAndClocks) {
  PaperRecordingOptions options = Short().recording;
  options.duration_s = 8;
  options.board_rate_hz = 25;  // the path has more views than knots
  options.first_camera_early_s = 0.008;
  ASSERT_OK_AND_ASSIGN(const PaperRecording recording, RecordPaper(options, PaperTarget::kCircles));
  ASSERT_OK_AND_ASSIGN(const CalibrationResult solved, SolveSpline(recording.input));
  ASSERT_THAT(solved.cameras, SizeIs(kPaperCameras));
  for (const CalibratedCamera& camera : solved.cameras) {
    // frame_0, the reference, is 8 ms early. At 1.5 m/s and 3 m, 0.1 ms are 0.06 px, and the noise
    // of an event camera, 0.35 px of each coordinate, is 0.5 ms.
    const double expected_s = camera.camera == "frame_0" ? 0 : 0.008;
    const bool event = camera.camera.starts_with("event");
    EXPECT_NEAR(camera.time_offset_s, expected_s, event ? 6e-4 : 1e-4) << camera.camera;
    EXPECT_GT(camera.residuals.all.marker_count, 100u) << camera.camera;
    const PaperNoise noise = NoiseOf(PaperTarget::kCircles);
    EXPECT_LT(camera.residuals.all.mean_px,
              3 * kMeanOfRayleigh * (event ? noise.event_px : noise.frame_px))
        << camera.camera;
  }
  ASSERT_OK_AND_ASSIGN(const PathErrors errors,
                       ComparePathOf(solved, recording.exact_marker, recording.path));
  EXPECT_LT(errors.mean_m, 3e-4);
}

// Gross errors of single points, which a least-squares solve would follow. Whole rows that are
// shifted are another pose of the board, which a spline with knots as near as its rows may follow.
TEST(SplineSolve, LeavesOutliersAside) {
  PaperRecordingOptions options = Short().recording;
  options.board_rate_hz = 10;
  ASSERT_OK_AND_ASSIGN(PaperRecording recording, RecordPaper(options, PaperTarget::kChecker));
  for (server::CameraTrack& track : recording.input.tracks) {
    for (size_t i = 0; i < track.observations.size(); ++i) {
      auto& markers = track.observations[i].markers;
      for (size_t m = i % 7; m < markers.size(); m += 7) markers[m].centre_px.x() += 25;
    }
  }
  ASSERT_OK_AND_ASSIGN(const CalibrationResult solved, SolveSpline(recording.input));
  ASSERT_OK_AND_ASSIGN(const PathErrors errors,
                       ComparePathOf(solved, recording.exact_marker, recording.path));
  EXPECT_LT(errors.mean_m, 1e-3);  // 25 px at 3 m are 60 mm
}

// A short film; what a test compares with the projections of the truth.
PaperRecordingOptions ShortFilm() {
  PaperRecordingOptions options;
  options.duration_s = 0.6;
  options.path_s = 0.6;
  options.board_rate_hz = 10;
  return options;
}

// Root mean square of the distances of found centres from `truth`'s, by row and marker; both have
// the same rows.
double RmsPx(const std::vector<Observation>& found, const std::vector<Observation>& truth,
             int* count) {
  double squares_px2 = 0;
  *count = 0;
  for (size_t i = 0; i < std::min(found.size(), truth.size()); ++i) {
    for (size_t m = 0; m < found[i].markers.size(); ++m) {
      if (!found[i].markers[m].visible || !truth[i].markers[m].visible) continue;
      squares_px2 += (found[i].markers[m].centre_px - truth[i].markers[m].centre_px).squaredNorm();
      ++*count;
    }
  }
  return std::sqrt(squares_px2 / std::max(1, *count));
}

TEST(FilmCamera, FindsTheWandWhereItIs) {
  const PaperRecordingOptions options = ShortFilm();
  ASSERT_OK_AND_ASSIGN(const PaperScene scene,
                       PaperScene::Create(options, PaperTarget::kWand, PaperMotion::kWave));
  ASSERT_OK_AND_ASSIGN(const PaperRecording points, RecordPaper(options, PaperTarget::kWand));
  for (const int camera : {1, kPaperFrameCameras}) {
    ASSERT_OK_AND_ASSIGN(const auto rows, FilmCamera(scene, options, camera));
    const auto& truth = points.input.tracks[static_cast<size_t>(camera)].observations;
    ASSERT_EQ(rows.size(), truth.size());
    int count = 0;
    const double rms_px = RmsPx(rows, truth, &count);
    EXPECT_GT(count, 20) << camera;
    // The points' own noise is 0.1 px; a flash up to 1 ms from the trigger shows the wand 1.5 mm
    // away, 0.7 px.
    EXPECT_LT(rms_px, camera == 1 ? 0.25 : 0.8) << camera;
    EXPECT_EQ(rows.back().time_ns / 1'000'000, truth.back().time_ns / 1'000'000);
  }
}

TEST(FilmCamera, FindsBoardsInFramesAndNoCheckerInEvents) {
  PaperRecordingOptions options = ShortFilm();
  options.board_turn_s = 4;
  for (const PaperTarget target : {PaperTarget::kCircles, PaperTarget::kChecker}) {
    ASSERT_OK_AND_ASSIGN(const PaperScene scene,
                         PaperScene::Create(options, target, PaperMotion::kWave));
    int count = 0;
    ASSERT_OK_AND_ASSIGN(const auto rows, FilmCamera(scene, options, 0));
    ASSERT_EQ(rows.size(), 6u);
    EXPECT_GT(ViewCount(rows), 3);
    std::vector<Observation> truth;
    for (int frame = 0; frame < scene.FrameCount(); frame += BoardFrameStep(options)) {
      truth.push_back(scene.world().ObserveWand(0, frame, scene.PoseAt(scene.TimeS(0, frame))));
    }
    EXPECT_LT(RmsPx(rows, truth, &count), 0.1);
    EXPECT_GT(count, 100);
    if (target == PaperTarget::kCircles) continue;
    ASSERT_OK_AND_ASSIGN(const auto none, FilmCamera(scene, options, kPaperFrameCameras));
    EXPECT_EQ(ViewCount(none), 0);
  }
}

TEST(PaperRun, SameForTwoRunsAndForOneAndTwoThreads) {
  PaperOptions options = Short();
  options.threads = 2;
  options.only = "together: ";
  const std::string csv = PaperCsv(RunPaper(options));
  EXPECT_THAT(csv, HasSubstr("checkerboard by rigcal"));
  options.threads = 1;
  EXPECT_EQ(csv, PaperCsv(RunPaper(options)));
  ++options.first_seed;
  options.only = "together: wand";
  EXPECT_THAT(csv, Not(HasSubstr(PaperCsv(RunPaper(options)))));
}

TEST(PaperRun, RigcalsWandIsNotWorseThanPairsByIndex) {
  PaperOptions options = Short();
  options.only = ": wand";
  const std::vector<PaperRow> rows = RunPaper(options);
  for (const std::string name : {"together", "frame_0 8 ms early"}) {
    SCOPED_TRACE(name);
    const PaperRow* paired = RowOf(rows, name + ": wand, paired by index");
    const PaperRow* rigcal = RowOf(rows, name + ": wand by rigcal");
    ASSERT_TRUE(paired != nullptr && rigcal != nullptr);
    ASSERT_EQ(paired->solved, 1) << paired->first_failure;
    ASSERT_EQ(rigcal->solved, 1) << rigcal->first_failure;
    EXPECT_LE(rigcal->path_m.Mean(), paired->path_m.Mean());
    EXPECT_LE(rigcal->exact_path_m.Mean(), paired->exact_path_m.Mean());
    for (const PaperCamera& camera : rigcal->cameras) {
      const PaperNoise noise = NoiseOf(PaperTarget::kWand);
      const bool event = camera.camera.starts_with("event");
      const double expected_px = kMeanOfRayleigh * (event ? noise.event_px : noise.frame_px);
      // The solve takes some degrees of freedom out of the noise.
      EXPECT_LT(camera.error_px.Mean(), 1.05 * expected_px) << camera.camera;
      EXPECT_GT(camera.error_px.Mean(), 0.6 * expected_px) << camera.camera;
    }
  }
}

TEST(PaperRun, TheTrueRigLeavesWhatTheNoiseDoes) {
  PaperOptions options = Short();
  options.only = "the true rig";
  const std::vector<PaperRow> rows = RunPaper(options);
  ASSERT_THAT(rows, SizeIs(4));  // boards that are noisy do not change it
  for (const PaperRow& row : rows) {
    SCOPED_TRACE(NameOf(row));
    ASSERT_EQ(row.solved, 1) << row.first_failure;
    // 0.06 px at 2 to 6 m and 1250 px are 0.1 to 0.3 mm in each of two views.
    EXPECT_LT(row.path_m.Mean(), 3e-4);
    EXPECT_GT(row.path_m.Mean(), 5e-5);
    // What the comparison itself resolves: 10 us at 1.5 m/s.
    EXPECT_LT(row.exact_path_m.Mean(), 1.5e-5);
  }
}

TEST(PaperRun, ABumpedCameraShowsInThePathOfTheMarker) {
  PaperRecordingOptions options = Short().recording;
  options.bump_m = 0.005;
  ASSERT_OK_AND_ASSIGN(const PaperRecording bumped, RecordPaper(options, PaperTarget::kWand));
  options.bump_m = 0;
  ASSERT_OK_AND_ASSIGN(const PaperRecording still, RecordPaper(options, PaperTarget::kWand));
  ASSERT_OK_AND_ASSIGN(const PathErrors known,
                       ComparePathOf(bumped.true_rig, bumped.marker, bumped.path));
  ASSERT_OK_AND_ASSIGN(const PathErrors unknown,
                       ComparePathOf(still.true_rig, bumped.marker, bumped.path));
  EXPECT_LT(known.mean_m, 3e-4);
  EXPECT_GT(unknown.mean_m, 5e-4);
  EXPECT_LT(unknown.mean_m, 5e-3);
}

TEST(PaperReport, NamesTheCommandOfEachRow) {
  PaperOptions options;
  options.first_seed = 7;
  PaperRow solved, failed;
  solved.condition = failed.condition = "together";
  solved.method = PaperMethod::kWand;
  solved.cameras.emplace_back().camera = "frame_0";
  solved.cameras[0].error_px.Add(3, 5, 10);  // a standard deviation of 4
  solved.path_m.Add(0.001, 0.001, 10);
  solved.exact_path_m.Add(0.001, 0.001, 10);
  solved.solved = 1;
  failed.method = PaperMethod::kChecker;
  failed.first_failure = absl::FailedPreconditionError("nobody saw it");
  const std::string page = PaperPage(options, {solved, failed}, {});
  EXPECT_THAT(page, HasSubstr("| together: wand by rigcal | frame_0 3.000 (4.000) | "
                              "`rigcal-accuracy paper --first-seed 7 --only \"together: wand by "
                              "rigcal\"` |"));
  EXPECT_THAT(page, HasSubstr("nobody saw it"));
  EXPECT_THAT(page, HasSubstr("published as figures only"));
  EXPECT_THAT(page, HasSubstr("not kalibr"));
  const std::string csv = PaperCsv({solved, failed});
  EXPECT_THAT(csv, HasSubstr("I,together,\"wand by rigcal\",frame_0,px,3.000,4.000,10\n"));
  EXPECT_THAT(csv, Not(HasSubstr("checkerboard")));
}

TEST(PaperReport, SaysWhoDoesNotSeeTheTarget) {
  PaperRow row;
  row.condition = "together";
  row.method = PaperMethod::kCircles;
  row.cameras.resize(2);
  row.cameras[0].camera = "frame_0";
  row.cameras[0].error_px.Add(1, 1, 10);
  row.cameras[1].camera = "event_0";
  row.cameras[1].views = 3;
  row.path_m.Add(0.001, 0.001, 10);
  row.exact_path_m.Add(0.001, 0.001, 10);
  row.solved = 1;
  EXPECT_THAT(PaperText({}, {row}, {}), HasSubstr("not seen (3)"));
  EXPECT_THAT(PaperPage({}, {row}, {}), HasSubstr("event_0 not seen (3)"));
  const std::string csv = PaperCsv({row});
  EXPECT_THAT(csv, HasSubstr("views,together,\"circle board by rigcal\",event_0,,,,3\n"));
  EXPECT_THAT(csv, Not(HasSubstr("event_0,px")));
  EXPECT_THAT(csv, Not(HasSubstr("nan")));
}

TEST(PaperReport, DigestIsOfTheFiguresThatArePrinted) {
  PaperRow row;
  row.condition = "together";
  row.path_m.Add(0.0012344, 0.0012344, 10);
  row.exact_path_m = row.path_m;
  row.solved = 1;
  const std::string digest = PaperDigest({row});
  EXPECT_THAT(digest, SizeIs(64));
  PaperRow same = row, other = row;
  same.path_m.sum += 1e-9;  // 1e-10 m
  other.path_m.sum += 2e-5;
  EXPECT_EQ(PaperDigest({same}), digest);
  EXPECT_NE(PaperDigest({other}), digest);
}

TEST(PaperRun, EnoughWavingIsWhereTheErrorStays) {
  PaperRow row;
  row.solved = 1;
  EXPECT_FALSE(EnoughWavingS(row).has_value());
  // By chance good after 5 s, not after 10.
  const double errors_mm[] = {9, 1.1, 1.5, 1.1, 1};
  for (int i = 0; i < 5; ++i) {
    PaperShorterWave& shorter = row.course.emplace_back();
    shorter.waved_s = 5.0 * i;
    shorter.exact_path_m.Add(1e-3 * errors_mm[i], 1e-3 * errors_mm[i], 10);
    shorter.solved = 1;
  }
  EXPECT_EQ(EnoughWavingS(row), 15);
  row.course[3].solved = 0;
  EXPECT_EQ(EnoughWavingS(row), 20);
}

TEST(PaperPlot, RefusesWhatItCannotDraw) {
  PaperRow row;
  const rigcal::testing::TemporaryDirectory folder;
  EXPECT_THAT(DrawPaper({row}, folder.path() / "a.png"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("nothing to draw")));
  row.course.emplace_back().waved_s = 5;
  row.course[0].solved = 1;
  row.course[0].exact_path_m.Add(1e-4, 1e-4, 10);
  EXPECT_THAT(DrawPaper({row}, folder.path() / "a.png"), IsOk());
  EXPECT_GT(std::filesystem::file_size(folder.path() / "a.png"), 1000u);
  EXPECT_THAT(DrawPaper({row}, folder.path() / "nowhere/a.png"),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("nowhere")));
}

// Of tests/accuracy/paper/digests.txt: NAME DIGEST ARGUMENTS...
std::string DigestOf(const std::string& name) {
  std::ifstream file(RIGCAL_SOURCE_DIR "/tests/accuracy/paper/digests.txt");
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string first, digest;
    words >> first >> digest;
    if (first == name) return digest;
  }
  return "";
}

// From light to tables: the same digits on every build and CPU.
TEST(PaperRun, ShortVersionHasItsDigest) {
  PaperOptions options;
  options.recording.duration_s = 5;
  options.recording.path_s = 2;
  options.only = "together: wand";
  const std::vector<PaperRow> rows = RunPaper(options);
  ASSERT_THAT(rows, Not(SizeIs(0)));
  EXPECT_EQ(PaperDigest(rows), DigestOf("short")) << PaperCsv(rows);
}

TEST(Paper, SaysWhatItDoesNotKnow) {
  CaptureStdout();
  CaptureStderr();
  const char* const arguments[] = {"rigcal-accuracy", "paper", "--only", "nothing"};
  EXPECT_EQ(RunExperiment({Paper()}, 4, arguments), 1);
  EXPECT_EQ(GetCapturedStdout(), "");
  EXPECT_THAT(GetCapturedStderr(), HasSubstr("no row has \"nothing\" in its name"));
}

TEST(Paper, RefusesADataFolderWithoutTheRecording) {
  CaptureStdout();
  CaptureStderr();
  const char* const arguments[] = {"rigcal-accuracy", "paper",  "--only",
                                   "recording",       "--data", "/nowhere"};
  EXPECT_EQ(RunExperiment({Paper()}, 6, arguments), 1);
  GetCapturedStdout();
  EXPECT_THAT(GetCapturedStderr(), HasSubstr("/nowhere"));
}

}  // namespace
}  // namespace rigcal::accuracy::paper_test
