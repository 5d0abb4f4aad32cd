// SPDX-License-Identifier: Apache-2.0
// Clocks that are up to a day apart, by the code in the wand's light.
#include <fmt/core.h>

#include <algorithm>
#include <memory>
#include <string>

#include "tests/accuracy/detection/detection_experiments.h"
#include "tests/accuracy/detection/light_code_waves.h"

namespace rigcal::accuracy {
namespace {

int PrintLightCode(const LightCodeOptions& options) {
  const auto waves = RunLightCode(options);
  fmt::print(
      "{} s of waving, {} frame cameras of 24 to 120 Hz and {} event cameras, clocks up to a day "
      "apart\n\n"
      "seed  wand  its clock  read  wrong  after s  by the code: ms  frames  solved: ms  with "
      "events\n",
      options.duration_s, options.frame_cameras, options.event_cameras);
  int failed = 0, within_frame = 0, wrong = 0, solved = 0;
  double worst_ms = 0;
  for (const LightCodeWave& wave : waves) {
    const bool all_read = wave.status.ok() && wave.read == wave.cameras;
    within_frame += all_read && wave.coarse_frames < 1 ? 1 : 0;
    wrong += wave.wrong > 0 ? 1 : 0;
    failed += wave.status.ok() ? 0 : 1;
    solved += wave.solved_s >= 0 ? 1 : 0;
    worst_ms = std::max(worst_ms, 1e3 * wave.solved_s);
    fmt::print("{:4} {:5} {:+9.2f} % {:3}/{} {:6} {:8.1f} {:16.2f} {:7.2f} {:11.3f} {:12.3f}{}\n",
               wave.seed, wave.wand, 100 * (wave.wand_rate - 1), wave.read, wave.cameras,
               wave.wrong, wave.read_after_s, 1e3 * wave.coarse_s, wave.coarse_frames,
               1e3 * wave.solved_s, 1e3 * wave.solved_events_s,
               wave.status.ok() && wave.solved.ok()
                   ? ""
                   : "  " + (wave.status.ok() ? wave.solved : wave.status).ToString());
  }
  fmt::print(
      "\nread by all cameras, right to a frame: {} of {}; wrong: {}; solved: {}, largest error "
      "{:.3f} ms\n",
      within_frame, waves.size(), wrong, solved, worst_ms);
  return failed > 0 || wrong > 0 ? 1 : 0;
}

Experiment::Run PrepareLightCode(OptionList* list) {
  const auto options = std::make_shared<LightCodeOptions>();
  list->Add("--seeds", &options->seeds, 1, 1000, "waves");
  list->Add("--first-seed", &options->first_seed, 0, 1 << 30, "lowest seed");
  list->Add("--threads", &options->threads, 1, 256, "waves at the same time");
  list->Add("--duration", &options->duration_s, 1, 600, "seconds of waving");
  list->Add("--frame-cameras", &options->frame_cameras, 1, 20, "of 24 to 120 frames a second");
  list->Add("--event-cameras", &options->event_cameras, 0, 20, "of 200 outputs a second");
  list->Add("--room", &options->room, "options of the renderer: \"lux=300;clutter=1\"");
  return [options] { return PrintLightCode(*options); };
}

}  // namespace

Experiment LightCodeExperiment() {
  return {"light_code", "clocks up to a day apart, by the code in the wand's light",
          PrepareLightCode};
}

}  // namespace rigcal::accuracy
