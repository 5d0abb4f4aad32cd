// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/damage_note.h"

#include "server/store/sqlite/sqlite_connection.h"

namespace rigcal::server {

std::vector<DamageNote> NewDamage(SQLite::Database& database, absl::Span<const DamageNote> notes) {
  std::vector<DamageNote> added;
  SQLite::Statement find(database, "SELECT 1 FROM damaged_batch WHERE batch_id=?");
  for (const DamageNote& note : notes) {
    const StatementScope scope(find);
    BindAll(find, note.batch_id);
    if (!find.executeStep()) added.push_back(note);
  }
  return added;
}

void NoteDamage(SQLite::Database& database, absl::Span<const DamageNote> notes) {
  // A camera that was deleted meanwhile needs no note.
  SQLite::Statement insert(
      database,
      "INSERT OR IGNORE INTO damaged_batch(batch_id, camera_id, row_count, example) "
      "SELECT ?1, ?2, ?3, ?4 WHERE EXISTS(SELECT 1 FROM session_camera WHERE id=?2)");
  for (const DamageNote& note : notes) {
    Execute(insert, note.batch_id, note.camera_id, note.row_count, note.example);
  }
}

}  // namespace rigcal::server
