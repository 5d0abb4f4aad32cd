// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "common/target/observation.h"
#include "tests/accuracy/paper/paper_recording.h"
#include "tests/accuracy/paper/paper_scene.h"

namespace rigcal::accuracy {

// What the detectors of an agent make of the pictures or events of one camera, rendered from light
// on; a row for each frame of the trigger that shows the target (BoardFrameStep), empty where it is
// not found. Of a board before an event camera, a row for each picture of EventBoardDetector with
// the board; none of a checkerboard, which it does not find. Follows from the options alone.
absl::StatusOr<std::vector<Observation>> FilmCamera(const PaperScene& scene,
                                                    const PaperRecordingOptions& options,
                                                    int camera);

}  // namespace rigcal::accuracy
