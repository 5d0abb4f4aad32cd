// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/sql/damage_note.h"
#include "server/store/sql/sql_database.h"
#include "server/store/store.h"

namespace rigcal::server {

using NoteDamaged = std::function<void(const std::vector<DamageNote>&)>;

// Store::OpenObservations. Reads in short pieces, with no lock held between them. `reader` must
// outlive the cursor. `note_damaged` gets what was found damaged, stream by stream, the rest when
// the cursor ends early.
absl::StatusOr<std::unique_ptr<ObservationCursor>> OpenObservations(SqlReader& reader,
                                                                    std::string_view session_id,
                                                                    std::string_view camera,
                                                                    NoteDamaged note_damaged);

// Store::GetStream, inside a Read. May throw the database's errors.
absl::StatusOr<StreamStatus> ReadStreamStatus(SqlDatabase& database, const StreamKey& stream);

}  // namespace rigcal::server
