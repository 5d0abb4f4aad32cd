// SPDX-License-Identifier: Apache-2.0
#include "server/store/sqlite/count_changes.h"

#include <tuple>

#include "absl/strings/str_cat.h"
#include "server/store/sqlite/sqlite_connection.h"

namespace rigcal::server {

CountChanges::CountChanges(SQLite::Database& database)
    : add_to_camera_(database,
                     "UPDATE session_camera SET observation_count=observation_count+?, "
                     "wand_count=wand_count+?, late_count=late_count+? WHERE id=?"),
      add_to_clock_epoch_(
          database,
          "INSERT INTO clock_epoch_count(camera_id, clock_epoch, observation_count) VALUES(?,?,?) "
          "ON CONFLICT DO UPDATE SET "
          "observation_count=observation_count+excluded.observation_count"),
      add_refusal_(
          database,
          "INSERT INTO refusal_count(camera_id, reason, count, example_stream_epoch, example_seq, "
          "example) VALUES(?,?,?,?,?,?) ON CONFLICT DO UPDATE SET count=count+excluded.count, "
          "(example_stream_epoch, example_seq, example)="
          "(SELECT min(example_stream_epoch, excluded.example_stream_epoch), "
          "CASE WHEN (excluded.example_stream_epoch, excluded.example_seq)<"
          "(example_stream_epoch, example_seq) THEN excluded.example_seq ELSE example_seq END, "
          "CASE WHEN (excluded.example_stream_epoch, excluded.example_seq)<"
          "(example_stream_epoch, example_seq) THEN excluded.example ELSE example END)") {}

void CountChanges::AddRows(int64_t camera_id, uint32_t clock_epoch, uint32_t observations,
                           uint32_t wands, bool late) {
  if (observations == 0) return;
  CameraChange& change = cameras_[camera_id];
  change.observations += observations;
  change.wands += wands;
  if (late) change.late += observations;
  change.clock_epochs[clock_epoch] += observations;
}

void CountChanges::AddRefusal(int64_t camera_id, RefusalReason reason, uint32_t count,
                              uint32_t stream_epoch, uint32_t first_seq, std::string_view detail) {
  RefusalChange& change = cameras_[camera_id].refusals[reason];
  if (change.count == 0 ||
      std::tie(stream_epoch, first_seq) < std::tie(change.stream_epoch, change.seq)) {
    change.stream_epoch = stream_epoch;
    change.seq = first_seq;
    change.detail = detail;
  }
  change.count += count;
}

void CountChanges::Flush() {
  for (const auto& [camera_id, change] : cameras_) FlushCamera(camera_id, change);
  cameras_.clear();
}

void CountChanges::FlushCamera(int64_t camera_id, const CameraChange& change) {
  if (change.observations > 0) {
    Execute(add_to_camera_, change.observations, change.wands, change.late, camera_id);
  }
  for (const auto& [clock_epoch, observations] : change.clock_epochs) {
    Execute(add_to_clock_epoch_, camera_id, clock_epoch, observations);
  }
  for (const auto& [reason, refusal] : change.refusals) {
    const std::string example = absl::StrCat("seq ", refusal.seq, ": ", refusal.detail);
    Execute(add_refusal_, camera_id, NameOf(reason), refusal.count, refusal.stream_epoch,
            refusal.seq, example);
  }
}

}  // namespace rigcal::server
