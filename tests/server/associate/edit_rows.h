// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "server/associate/align_clocks.h"

namespace rigcal::server {

// Changes the rows of a track.
inline void EditRows(AlignedTrack* track,
                     const std::function<void(std::vector<Observation>& rows)>& edit) {
  std::vector<Observation> rows;
  for (const Observation& row : track->track.observations) rows.push_back(row);
  edit(rows);
  track->track.observations = ObservationTable(rows);
}

inline void EditRow(AlignedTrack* track, size_t row,
                    const std::function<void(Observation& observation)>& edit) {
  EditRows(track, [row, &edit](std::vector<Observation>& rows) { edit(rows[row]); });
}

}  // namespace rigcal::server
