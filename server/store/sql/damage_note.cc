// SPDX-License-Identifier: Apache-2.0
#include "server/store/sql/damage_note.h"

#include "server/store/sql/sql_database.h"

namespace rigcal::server {

std::vector<DamageNote> NewDamage(SqlDatabase& database, absl::Span<const DamageNote> notes) {
  std::vector<DamageNote> added;
  SqlStatement find(database, "SELECT 1 FROM damaged_batch WHERE batch_id=?");
  for (const DamageNote& note : notes) {
    const StatementScope scope(find);
    BindAll(find, note.batch_id);
    if (!find.Step()) added.push_back(note);
  }
  return added;
}

void NoteDamage(SqlDatabase& database, absl::Span<const DamageNote> notes) {
  // A camera that was deleted meanwhile needs no note.
  SqlStatement insert(
      database,
      "INSERT INTO damaged_batch(batch_id, camera_id, row_count, example) "
      "SELECT ?1, ?2, ?3, ?4 WHERE EXISTS(SELECT 1 FROM session_camera WHERE id=?2) "
      "ON CONFLICT DO NOTHING");
  for (const DamageNote& note : notes) {
    Execute(insert, note.batch_id, note.camera_id, note.row_count, note.example);
  }
}

}  // namespace rigcal::server
