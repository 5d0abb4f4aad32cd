// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "common/camera/camera_description.h"
#include "common/session/observation_batch.h"
#include "common/session/session.h"
#include "common/session/stream_key.h"

namespace rigcal::server {

struct RowCollectionOptions {
  double max_rate_hz = 125;            // of a camera; faster ones are thinned to about this
  size_t max_rows_per_camera = 4'000;  // at which older time is thinned
  int64_t slot_ns = 500'000'000;       // of time that is kept or dropped as a whole
  size_t max_clock_samples = 200;      // of a camera, the newest
};

// Rows of the sessions that capture, thinned so that memory stays bounded however long they go on:
// at most max_rows_per_camera of each camera, from slots of time that are spread evenly over the
// session and are the same for all cameras. Within a slot rows keep their neighbours, which image
// motion needs. Times of cameras are made comparable by their first clock sample, where they have
// any. Thread-safe.
class RowCollection {
 public:
  explicit RowCollection(RowCollectionOptions options = {}) : options_(options) {}

  // Takes what it needs of the rows. Cheap: for the thread that writes observations.
  void Add(const StreamKey& stream, const ObservationBatch& batch);
  // Rows that `session_id` has from before: of a session that it continues, or its own from before
  // a restart. `camera` is that of the rows' session.
  void AddEarlier(const std::string& session_id, const SessionCamera& camera,
                  const ObservationBatch& batch);

  // What one camera has seen in one session.
  struct Track {
    std::string session_id;
    std::string camera;
    std::optional<CameraDescription> description;  // of a session before this one
    std::vector<ObservationBatch> rows;
  };
  struct Snapshot {
    std::vector<Track> tracks;  // by camera
    double data_share = 1;      // of all rows with a marker
    uint64_t seen_count = 0;    // rows with a marker, all in all
  };
  // None: nothing has arrived for this session.
  std::optional<Snapshot> Take(const std::string& session_id) const;
  void Forget(const std::string& session_id);
  // Sessions of which there are rows.
  std::vector<std::string> Sessions() const;

 private:
  struct Slot {
    int64_t index = 0;
    ObservationBatch batch;  // of one clock epoch
  };
  struct Camera {
    std::vector<Slot> slots;
    std::vector<ObservationBatch> clocks;  // samples and alignments without rows, by clock epoch
    std::optional<int64_t> clock_offset_ns;
    int64_t last_time_ns = 0;
    bool has_rows = false;
    size_t row_count = 0, wand_count = 0;  // kept
    uint64_t seen_count = 0;               // with a marker
    std::optional<CameraDescription> description;
  };
  // Camera, session of the rows, and whether they are new: rows from before come in between.
  using Key = std::tuple<std::string, std::string, bool>;
  struct SessionRows {
    std::map<Key, Camera> cameras;
    int level = 0;  // slots whose index is a multiple of 2^level are kept
  };

  void AddTo(SessionRows* session, const ObservationBatch& batch, const Key& key);
  void AddClocks(const ObservationBatch& batch, Camera* camera) const;
  void AddRow(const ObservationBatch& batch, size_t row, int64_t slot, Camera* camera) const;
  void Thin(SessionRows* session) const;

  const RowCollectionOptions options_;
  mutable std::mutex mutex_;
  std::map<std::string, SessionRows> sessions_;
};

}  // namespace rigcal::server
