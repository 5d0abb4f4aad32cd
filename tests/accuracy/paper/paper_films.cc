// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/paper/paper_films.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/simulation/world/random_stream.h"
#include "common/status/status_macros.h"
#include "tests/accuracy/paper/film_camera.h"

namespace rigcal::accuracy {
namespace {

constexpr uint64_t kGivenPurpose = 0x706170657267;

// What is said about a target that is off.
Target GivenTarget(const PaperRecordingOptions& options, Target target) {
  RandomStream random{options.seed, kGivenPurpose};
  if (options.wand_sigma_m > 0) {
    double off_m = 0;
    for (size_t m = 1; m < target.marker_positions_m.size(); ++m) {
      off_m += options.wand_sigma_m * random.Gaussian();
      target.marker_positions_m[m] += off_m;
    }
  }
  if (options.board_sigma_m > 0 && !target.points.empty()) {
    target.board.clear();
    for (TargetPoint& point : target.points) {
      for (double* coordinate : {&point.x_m, &point.y_m, &point.z_m}) {
        *coordinate += options.board_sigma_m * random.Gaussian();
      }
    }
  }
  return target;
}

}  // namespace

PaperFilms::Film& PaperFilms::FilmOf(const std::string& key) {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::unique_ptr<Film>& film = films_[key];
  if (!film) film = std::make_unique<Film>();
  return *film;
}

absl::StatusOr<std::vector<Observation>> PaperFilms::Rows(const PaperRecordingOptions& options,
                                                          const PaperScene& scene,
                                                          PaperTarget target, int camera) {
  const bool is_path = scene.motion() == PaperMotion::kPath;
  // What this camera's picture depends on, of what conditions change.
  const double early_s = camera == 0 ? options.first_camera_early_s : 0;
  const bool is_bumped = is_path && camera == 1;
  Film& film = FilmOf(absl::StrCat(
      options.seed, " ", is_path ? "path" : absl::StrCat("wave ", static_cast<int>(target)), " ",
      camera, " ", early_s, " ", is_bumped ? options.bump_m : 0, " ",
      is_bumped ? options.bump_rad : 0));
  std::call_once(film.once, [&] { film.rows = FilmCamera(scene, options, camera); });
  return film.rows;
}

absl::StatusOr<PaperRecording> PaperFilms::Record(const PaperRecordingOptions& options,
                                                  PaperTarget target) {
  PaperRecordingOptions exact = options;
  exact.wand_sigma_m = exact.board_sigma_m = 0;
  PaperRecording recording;
  RIGCAL_RETURN_IF_ERROR(RecordPaperPath(exact, &recording));
  recording.exact_marker.resize(kPaperFrameCameras);
  RIGCAL_ASSIGN_OR_RETURN(const PaperScene wave,
                          PaperScene::Create(exact, target, PaperMotion::kWave));
  RIGCAL_ASSIGN_OR_RETURN(const PaperScene path,
                          PaperScene::Create(exact, PaperTarget::kWand, PaperMotion::kPath));
  recording.input.target = GivenTarget(options, wave.target());
  for (int c = 0; c < kPaperCameras; ++c) {
    RIGCAL_ASSIGN_OR_RETURN(std::vector<Observation> rows, Rows(options, wave, target, c));
    const CameraDescription camera = wave.DescriptionOf(c);
    const int views = ViewCount(rows);
    recording.views.emplace_back(camera.camera, views);
    if (views >= kPaperLeastViews) {
      server::CameraTrack& track = recording.input.tracks.emplace_back();
      track.session_id = "wave";
      track.camera = camera;
      track.observations = std::move(rows);
    }
    RIGCAL_ASSIGN_OR_RETURN(rows, Rows(options, path, PaperTarget::kWand, c));
    for (Observation& row : rows) row.markers = {row.markers[kPaperPathMarker]};
    recording.marker[static_cast<size_t>(c)].rows = std::move(rows);
  }
  return recording;
}

}  // namespace rigcal::accuracy
