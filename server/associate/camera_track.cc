// SPDX-License-Identifier: Apache-2.0
#include "server/associate/camera_track.h"

namespace rigcal::server {

void AddRows(const ObservationBatch& batch, CameraTrack* track) {
  for (size_t row = 0; row < batch.rows(); ++row) track->observations.push_back(batch.Row(row));
  for (const ClockSample& sample : batch.clock_samples) {
    track->clock_samples.push_back({batch.clock_epoch, sample});
  }
  track->host_alignments.insert(track->host_alignments.end(), batch.host_alignments.begin(),
                                batch.host_alignments.end());
}

}  // namespace rigcal::server
