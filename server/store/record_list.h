// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <tuple>

#include "common/calibration/calibration_record.h"
#include "common/session/session.h"

namespace rigcal::server {

struct SessionFilter {
  std::string rig = {};  // empty: every rig
  std::optional<SessionState> state = {};
};

struct CalibrationFilter {
  std::string rig = {};  // empty: every rig
  std::optional<CalibrationState> state = {};
  std::string session_id = {};  // empty: of any sessions
};

// A rig, by what there is of it.
struct RigSummary {
  std::string name;
  uint32_t calibration_count = 0;  // whatever their state
};

enum class RecordOrder : uint8_t { kNewestFirst, kOldestFirst, kIdAscending, kIdDescending };

// Where a record is in every order. Stays valid when the record is deleted.
struct RecordPosition {
  int64_t time = 0;  // grows with each record
  std::string id;

  friend bool operator==(const RecordPosition&, const RecordPosition&) = default;
};

// In a list with this order, `a` is before `b`. Records of one time are ordered by id.
inline bool Precedes(const RecordPosition& a, const RecordPosition& b, RecordOrder order) {
  switch (order) {
    case RecordOrder::kNewestFirst:
      return std::tie(b.time, b.id) < std::tie(a.time, a.id);
    case RecordOrder::kOldestFirst:
      return std::tie(a.time, a.id) < std::tie(b.time, b.id);
    case RecordOrder::kIdAscending:
      return a.id < b.id;
    case RecordOrder::kIdDescending:
      return b.id < a.id;
  }
  return false;
}

// Part of a list.
struct ListPage {
  RecordOrder order = RecordOrder::kNewestFirst;
  int limit = 0;                             // at least 1
  std::optional<RecordPosition> after = {};  // those after this one; none: from the first on
};

template <typename Record>
struct Listed {
  Record record;
  RecordPosition position;
};

}  // namespace rigcal::server
