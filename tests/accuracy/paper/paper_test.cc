// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/paper/paper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tests/accuracy/paper/index_paired_solve.h"
#include "tests/accuracy/paper/paper_recording.h"
#include "tests/accuracy/paper/paper_report.h"
#include "tests/accuracy/paper/paper_run.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy::paper_test {
namespace {

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

TEST(IndexPairedSolve, RefusesBoardsAndRowsThatShareNothing) {
  ASSERT_OK_AND_ASSIGN(const PaperRecording board,
                       RecordPaper(Short().recording, PaperTarget::kCircles));
  EXPECT_THAT(SolveIndexPaired(board.input, {}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("wand")));
  ASSERT_OK_AND_ASSIGN(PaperRecording wand, RecordPaper(Short().recording, PaperTarget::kWand));
  EXPECT_THAT(SolveIndexPaired(wand.input, {}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("frame_0")));
  CalibrationResult start;
  for (server::CameraTrack& track : wand.input.tracks) {
    start.cameras.emplace_back().camera = track.camera.camera;
    track.observations.resize(5);
  }
  EXPECT_THAT(SolveIndexPaired(wand.input, start),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("fewer than 10")));
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
  EXPECT_THAT(page, HasSubstr("Missing: kalibr"));
  const std::string csv = PaperCsv({solved, failed});
  EXPECT_THAT(csv, HasSubstr("I,together,\"wand by rigcal\",frame_0,px,3,4,10\n"));
  EXPECT_THAT(csv, Not(HasSubstr("checkerboard")));
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
