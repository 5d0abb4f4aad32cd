// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/recording.h"

#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "tests/accuracy/rig/statistics.h"
#include "tests/server/solve/recorded_input.h"
#include "tests/testing/recorded_data.h"

namespace rigcal::accuracy {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

double AgainstOthers(const CalibrationResult& result, const std::string& name,
                     const std::function<double(const CalibratedCamera&)>& value) {
  double own = kNan;
  std::vector<double> others;
  for (const CalibratedCamera& camera : result.cameras) {
    if (camera.camera == name) {
      own = value(camera);
    } else {
      others.push_back(value(camera));
    }
  }
  return own - InterpolatedQuantile(others, 0.5);
}

}  // namespace

absl::StatusOr<std::filesystem::path> RecordingsFolder() {
  const auto data = testing::RecordedDataDirectory();
  if (data) return *data;
  return absl::NotFoundError("no recordings: put them into ../shared/data or set RIGCAL_TEST_DATA");
}

absl::StatusOr<server::CalibrationInput> WandRecording() {
  RIGCAL_ASSIGN_OR_RETURN(const std::filesystem::path folder, RecordingsFolder());
  return server::RecordedInput(folder);
}

absl::StatusOr<server::CalibrationInput> Change(const server::CalibrationInput& input,
                                                const ClockChange& change) {
  server::CalibrationInput changed = input;
  for (server::CameraTrack& track : changed.tracks) {
    if (track.camera.camera != change.camera) continue;
    std::vector<Observation> rows;
    const int64_t first_ns = track.observations.front().time_ns;
    for (size_t i = 0; i < track.observations.size(); ++i) {
      if (change.drop_every_third && i % 3 == 2) continue;
      Observation row = track.observations[i];
      const double elapsed_s = 1e-9 * static_cast<double>(row.time_ns - first_ns);
      row.time_ns += std::llround(1e9 * (change.shift_s + 1e-6 * change.rate_ppm * elapsed_s));
      rows.push_back(std::move(row));
    }
    track.observations = std::move(rows);
    return changed;
  }
  return absl::NotFoundError(absl::StrCat("the recording has no camera ", change.camera));
}

double OffsetAgainstOthersS(const CalibrationResult& result, const std::string& camera,
                            double camera_time_s) {
  return AgainstOthers(result, camera, [camera_time_s](const CalibratedCamera& one) {
    return one.time_offset_s + 1e-6 * one.time_rate_ppm * (camera_time_s - one.time_epoch_s);
  });
}

double RateAgainstOthersPpm(const CalibrationResult& result, const std::string& camera) {
  return AgainstOthers(result, camera,
                       [](const CalibratedCamera& one) { return one.time_rate_ppm; });
}

}  // namespace rigcal::accuracy
