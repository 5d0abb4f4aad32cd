// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/seed_options.h"

#include <memory>

namespace rigcal::accuracy {

Experiment SeedExperiment(const std::string& name, const std::string& summary,
                          const SeedOptions& defaults,
                          const std::function<int(const SeedOptions&)>& run) {
  return {name, summary, [defaults, run](OptionList* options) -> Experiment::Run {
            const auto seeds = std::make_shared<SeedOptions>(defaults);
            options->Add("--seeds", &seeds->count, 1, 100000, "number of seeds");
            options->Add("--first-seed", &seeds->first, 0, 1 << 30, "lowest seed");
            options->Add("--threads", &seeds->threads, 1, 256, "seeds run at the same time");
            options->Add("--cameras", &seeds->camera_count, 2, 500,
                         "cameras of the simulated rig (solver experiments); of large: most");
            options->Add("--duration", &seeds->duration_s, 1, 3600,
                         "seconds of waving (solver experiments)");
            options->AddFlag("--verbose", &seeds->verbose, "print a line for each seed");
            options->AddFlag("--spline", &seeds->spline,
                             "follow the target through time (line_delays, sparse)");
            options->AddFlag("--instants", &seeds->instants,
                             "do not follow it (line_delays, sparse)");
            options->Add("--only", &seeds->only,
                         "cases with this in their name (doctor, detection, stated, "
                         "triangulate); of monitor: quiet, recording");
            return [seeds, run] { return run(*seeds); };
          }};
}

}  // namespace rigcal::accuracy
