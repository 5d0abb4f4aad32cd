// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/types/span.h"
#include "common/calibration/calibration.h"
#include "common/calibration/calibration_options.h"
#include "common/session/session.h"
#include "server/store/delivery.h"

namespace rigcal::server {

// How many of the rows that one camera detected in one session go into a calibration, counted while
// they are read. For one thread.
class RowShare {
 public:
  // `counts`: none where the store has nothing of the camera.
  RowShare(std::string session_id, std::string camera, const SessionCameraCounts* counts);

  void Add(const StoredBatch& stored);

  const std::string& session_id() const { return session_id_; }
  const std::string& camera() const { return camera_; }
  // Numbers that were given, as far as anybody knows.
  uint64_t detected() const;
  uint64_t read() const { return read_; }  // refused ones included
  uint64_t damaged() const { return damaged_; }
  uint64_t late() const { return late_; }
  // A stream of it has not ended: what was detected behind its last row is not known.
  bool has_open_stream() const { return has_open_stream_; }
  // From the first row to the last one, over its clock epochs.
  double span_s() const;

 private:
  std::string session_id_;
  std::string camera_;
  bool has_open_stream_ = true;
  std::map<uint32_t, uint64_t> last_seq_;  // by stream epoch
  uint64_t read_ = 0, damaged_ = 0, late_ = 0;
  std::map<uint32_t, std::pair<int64_t, int64_t>> times_ns_;  // first and last, by clock epoch
};

// Shares of a camera's rows above which a calibration without them is no better than usable, and
// than bad: what is missing is not spread evenly over a wave, and a camera of which most is missing
// saw another volume than its figures are about.
inline constexpr double kUsableWithoutShare = 0.1;
inline constexpr double kBadWithoutShare = 0.4;

// Adds a finding for each camera of which rows are missing, and caps the grade by their share; of a
// stream without an end at least to usable, as nobody knows what is behind it. Where nothing is
// solved the findings are for information; what `options` leave out is not looked at. `shares`: in
// any order.
void NoteIncompleteSessions(absl::Span<const RowShare> shares, const CalibrationOptions& options,
                            CalibrationResult* result);

}  // namespace rigcal::server
