// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/recorded/csv_observation_source.h"

#include <map>
#include <string>
#include <thread>
#include <vector>

#include "tests/agent/capture/camera_yaml.h"
#include "tests/testing/recorded_data.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::csv_observation_source_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;

Target WandOf(int marker_count) {
  Target target;
  for (int marker = 0; marker < marker_count; ++marker) {
    target.marker_positions_m.push_back(0.1 * marker);
  }
  return target;
}

class CsvObservationSourceTest : public ::testing::Test {
 protected:
  CsvSourceOptions Options(const std::string& csv) {
    CsvSourceOptions options;
    options.camera = "left";
    options.path = directory_.WriteFile("left.csv", csv).string();
    options.calibration_path = directory_.WriteFile("left.yaml", kCameraYaml).string();
    options.speed = kMaxSpeed;
    return options;
  }

  static std::vector<Observation> Drain(CsvObservationSource& source) {
    std::vector<Observation> observations;
    while (true) {
      auto next = source.Next();
      EXPECT_THAT(next, IsOk());
      if (!next.ok() || !next->has_value()) return observations;
      observations.push_back(**std::move(next));
    }
  }

  static std::map<RefusalReason, uint64_t> Counts(const CsvObservationSource& source) {
    std::map<RefusalReason, uint64_t> counts;
    for (const Refusal& refusal : source.Refused()) counts[refusal.reason] = refusal.count;
    return counts;
  }

  TemporaryDirectory directory_;
};

TEST_F(CsvObservationSourceTest, TimesAreThoseOfTheMiddleOfTheExposure) {
  for (const auto& [stamps, time_ns] :
       {std::pair(StampMoment::kMiddle, 50'000'000), std::pair(StampMoment::kStart, 52'000'000),
        std::pair(StampMoment::kEnd, 48'000'000)}) {
    CsvSourceOptions options = Options("50000000;2;3\n");
    options.stamps = stamps;
    options.exposure_s = 0.004;
    ASSERT_OK_AND_ASSIGN(const auto source, CsvObservationSource::Create(options));
    ASSERT_THAT(source->Start(WandOf(1)), IsOk());
    EXPECT_EQ(Drain(*source).at(0).time_ns, time_ns);
  }
}

TEST_F(CsvObservationSourceTest, StampsOfTheStartNeedTheExposure) {
  CsvSourceOptions options = Options("1;2;3\n");
  options.stamps = StampMoment::kStart;
  EXPECT_THAT(CsvObservationSource::Create(options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("exposure=SECONDS")));
}

TEST_F(CsvObservationSourceTest, SaysWhatItWasToldThatTheCentresAre) {
  for (const CentreKind kind : {CentreKind::kImageBlob, CentreKind::kSphereCentre}) {
    CsvSourceOptions options = Options("1;2;3\n");
    options.centre_kind = kind;
    ASSERT_OK_AND_ASSIGN(const auto source, CsvObservationSource::Create(options));
    ASSERT_THAT(source->Start(WandOf(1)), IsOk());
    EXPECT_EQ(Drain(*source).at(0).markers[0].centre_kind, kind);
  }
}

TEST_F(CsvObservationSourceTest, DescribesTheCameraByItsNameAndCalibration) {
  ASSERT_OK_AND_ASSIGN(const auto source, CsvObservationSource::Create(Options("1;2;3\n")));
  const CameraDescription& camera = source->description();
  EXPECT_EQ(camera.camera, "left");
  EXPECT_EQ(camera.image_size_px, (ImageSize{1280, 1024}));
  ASSERT_TRUE(camera.intrinsics.has_value());
  EXPECT_EQ(camera.intrinsics->fx_px, 1255.4);
  EXPECT_EQ(camera.clock, (Clock{"left", "recording"}));
  EXPECT_EQ(camera.sensor, SensorKind::kFrame);
  EXPECT_EQ(camera.source, "csv:left.csv");
}

TEST_F(CsvObservationSourceTest, YieldsGoodLinesAndRefusesEachBadOneWithItsReason) {
  ASSERT_OK_AND_ASSIGN(auto source, CsvObservationSource::Create(Options("10;1;2;3;4\r\n"
                                                                         "20;1;2;3\r\n"
                                                                         "\r\n"
                                                                         "30;1;2;x;4\r\n"
                                                                         "40;inf;2;3;4\r\n"
                                                                         "5.5;1;2;3;4\r\n"
                                                                         "60;1;2;3;-1\r\n" +
                                                                         std::string(9999, '7') +
                                                                         "\r\n"
                                                                         "80;-1;-1;3;4\r\n"
                                                                         "90;1;2;y;4")));
  ASSERT_THAT(source->Start(WandOf(2)), IsOk());
  const std::vector<Observation> observations = Drain(*source);
  ASSERT_EQ(observations.size(), 2u);
  EXPECT_EQ(observations[0].time_ns, 10);
  EXPECT_EQ(observations[1].time_ns, 80);
  EXPECT_EQ(observations[1].VisibleCount(), 1);
  EXPECT_THAT(
      Counts(*source),
      ElementsAre(Pair(RefusalReason::kCsvBadTime, 1), Pair(RefusalReason::kCsvFieldCount, 1),
                  Pair(RefusalReason::kCsvHalfMarker, 1), Pair(RefusalReason::kCsvLineTooLong, 1),
                  Pair(RefusalReason::kCsvNotANumber, 2), Pair(RefusalReason::kCsvNotFinite, 1)));
  // The first one of a reason is the example.
  const std::string path = (directory_.path() / "left.csv").string();
  for (const Refusal& refusal : source->Refused()) {
    EXPECT_TRUE(refusal.camera.empty());
    if (refusal.reason != RefusalReason::kCsvNotANumber) continue;
    EXPECT_EQ(refusal.example, path + ":4: x1 is \"x\", not a number");
  }
}

TEST_F(CsvObservationSourceTest, OpensAClockEpochWhereTimeJumpsBackAndPassesEqualTimes) {
  ASSERT_OK_AND_ASSIGN(auto source, CsvObservationSource::Create(Options("10;1;2\n20;1;2\n20;5;6\n"
                                                                         "19;1;2\n30;1;2\n1;1;2")));
  ASSERT_THAT(source->Start(WandOf(1)), IsOk());
  std::vector<uint32_t> epochs;
  for (const Observation& observation : Drain(*source)) epochs.push_back(observation.clock_epoch);
  EXPECT_THAT(epochs, ElementsAre(0, 0, 0, 1, 1, 2));
  EXPECT_THAT(source->Refused(), IsEmpty());
}

TEST_F(CsvObservationSourceTest, RefusesAnEmptyFileWithAnExample) {
  for (const char* text : {"", "\n\r\n  \n"}) {
    ASSERT_OK_AND_ASSIGN(auto source, CsvObservationSource::Create(Options(text)));
    ASSERT_THAT(source->Start(WandOf(3)), IsOk());
    EXPECT_THAT(Drain(*source), IsEmpty());
    // Asking again does not count again.
    EXPECT_THAT(Drain(*source), IsEmpty());
    ASSERT_THAT(Counts(*source), ElementsAre(Pair(RefusalReason::kCsvEmpty, 1)));
    EXPECT_THAT(source->Refused()[0].example, AllOf(HasSubstr("left.csv: the file holds no line"),
                                                    HasSubstr("598370000;570.52;386.47;530.52")));
  }
}

TEST_F(CsvObservationSourceTest, RefusesATargetOfAnotherMarkerCount) {
  ASSERT_OK_AND_ASSIGN(auto source,
                       CsvObservationSource::Create(Options("\ngarbage\n10;1;2;3;4;5;6\n")));
  EXPECT_THAT(source->Start(WandOf(2)),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera left"), HasSubstr("left.csv shows 3 markers"),
                             HasSubstr("target has 2"))));
  EXPECT_THAT(source->Start(WandOf(3)), IsOk());
  EXPECT_EQ(Drain(*source).size(), 1u);
}

TEST_F(CsvObservationSourceTest, GoesOnWithAFileOfNothingButDamagedLines) {
  ASSERT_OK_AND_ASSIGN(auto source, CsvObservationSource::Create(Options("a,b\nc,d\n")));
  ASSERT_THAT(source->Start(WandOf(3)), IsOk());
  EXPECT_THAT(Drain(*source), IsEmpty());
  EXPECT_THAT(Counts(*source), ElementsAre(Pair(RefusalReason::kCsvFieldCount, 2)));
}

TEST_F(CsvObservationSourceTest, BeginsAnewAtEachStart) {
  ASSERT_OK_AND_ASSIGN(auto source, CsvObservationSource::Create(Options("9;1;2\nx;1;2\n3;1;2\n")));
  for (int capture = 0; capture < 2; ++capture) {
    ASSERT_THAT(source->Start(WandOf(1)), IsOk());
    const std::vector<Observation> observations = Drain(*source);
    ASSERT_EQ(observations.size(), 2u);
    EXPECT_EQ(observations[0].clock_epoch, 0u);
    EXPECT_EQ(observations[1].clock_epoch, 1u);
    EXPECT_THAT(Counts(*source), ElementsAre(Pair(RefusalReason::kCsvBadTime, 1)));
  }
}

TEST_F(CsvObservationSourceTest, StopWakesANextThatWaits) {
  CsvSourceOptions options = Options("0;1;2\n3600000000000;1;2\n");
  options.speed = 1;
  ASSERT_OK_AND_ASSIGN(auto source, CsvObservationSource::Create(options));
  ASSERT_THAT(source->Start(WandOf(1)), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto first, source->Next());
  ASSERT_TRUE(first.has_value());
  std::thread stopper([&] { source->Stop(); });
  ASSERT_OK_AND_ASSIGN(const auto second, source->Next());
  stopper.join();
  EXPECT_FALSE(second.has_value());
  ASSERT_OK_AND_ASSIGN(const auto third, source->Next());
  EXPECT_FALSE(third.has_value());
}

TEST_F(CsvObservationSourceTest, NeedsItsFilesAtCreation) {
  CsvSourceOptions options = Options("1;2;3\n");
  options.path = (directory_.path() / "missing.csv").string();
  EXPECT_THAT(CsvObservationSource::Create(options),
              StatusIs(absl::StatusCode::kNotFound,
                       AllOf(HasSubstr("camera left"), HasSubstr("missing.csv"))));
  options = Options("1;2;3\n");
  options.calibration_path = (directory_.path() / "missing.yaml").string();
  EXPECT_THAT(CsvObservationSource::Create(options),
              StatusIs(absl::StatusCode::kNotFound,
                       AllOf(HasSubstr("camera left"), HasSubstr("missing.yaml"),
                             HasSubstr("calibration=FILE"))));
  options.calibration_path = directory_.WriteFile("bad.yaml", "image_width: lots\n").string();
  EXPECT_THAT(CsvObservationSource::Create(options),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("camera left"), HasSubstr("bad.yaml"))));
}

TEST_F(CsvObservationSourceTest, ListsEveryFaultOfItsOptions) {
  CsvSourceOptions options;
  options.camera = "left";
  options.sigma_px = -1;
  options.speed = 0;
  EXPECT_THAT(CsvObservationSource::Create(options),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("path"), HasSubstr("sigma"), HasSubstr("speed"))));
}

TEST_F(CsvObservationSourceTest, ReadsTheRealRecording) {
  RIGCAL_REQUIRE_RECORDED_DATA(data);
  const std::vector<size_t> rows = {625, 619, 619, 619};
  for (size_t camera = 0; camera < rows.size(); ++camera) {
    const std::string stem = "frame_" + std::to_string(camera);
    CsvSourceOptions options;
    options.camera = stem;
    options.path = (data / "ewand" / (stem + ".csv")).string();
    options.calibration_path = (data / "ewand" / (stem + ".yaml")).string();
    options.speed = kMaxSpeed;
    ASSERT_OK_AND_ASSIGN(auto source, CsvObservationSource::Create(options));
    ASSERT_THAT(source->Start(WandOf(3)), IsOk());
    std::map<uint32_t, size_t> rows_of_epoch;
    for (const Observation& observation : Drain(*source)) ++rows_of_epoch[observation.clock_epoch];
    EXPECT_THAT(source->Refused(), IsEmpty());
    if (camera == 0) {
      EXPECT_THAT(rows_of_epoch, ElementsAre(Pair(0, rows[camera] - 6), Pair(1, 6)));
    } else {
      EXPECT_THAT(rows_of_epoch, ElementsAre(Pair(0, rows[camera])));
    }
  }
}

}  // namespace
}  // namespace rigcal::agent::csv_observation_source_test
