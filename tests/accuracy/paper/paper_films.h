// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/target/observation.h"
#include "tests/accuracy/paper/paper_recording.h"
#include "tests/accuracy/paper/paper_scene.h"

namespace rigcal::accuracy {

// Recordings like those of RecordPaper, rendered and detected. Each camera is rendered once for all
// conditions in which it sees the same. Differences from RecordPaper:
// - targets are exact, and what is given as their points is off by wand_sigma_m and board_sigma_m;
// - exact_marker holds the frame cameras alone.
// Any thread.
class PaperFilms {
 public:
  // Errors of RecordPaper, FilmCamera.
  absl::StatusOr<PaperRecording> Record(const PaperRecordingOptions& options, PaperTarget target);

 private:
  struct Film {
    std::once_flag once;
    absl::StatusOr<std::vector<Observation>> rows = absl::UnknownError("not rendered");
  };
  Film& FilmOf(const std::string& key);
  absl::StatusOr<std::vector<Observation>> Rows(const PaperRecordingOptions& options,
                                                const PaperScene& scene, PaperTarget target,
                                                int camera);

  std::mutex mutex_;
  std::map<std::string, std::unique_ptr<Film>> films_;
};

}  // namespace rigcal::accuracy
