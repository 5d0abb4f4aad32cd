// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "rigcal/v1/live_service.pb.h"
#include "server/live/live_state.h"
#include "server/live/live_tracker.h"

namespace rigcal::server {

// What has changed in `state` since revision `since`; all of it where that is older than what is
// known, or without it.
v1::LiveState ToProto(const LiveSnapshot& state, const std::optional<uint64_t>& since);

// The name of a state: LiveState.revision.
std::string RevisionOf(const LiveSnapshot& state);

// Answers of GetLive, each serialized once and given to all who ask for the same. Thread-safe.
class LiveAnswers {
 public:
  // `tracker` must outlive it; null: every rig is empty.
  explicit LiveAnswers(const LiveTracker* tracker) : tracker_(tracker) {}

  struct Answer {
    std::string revision;
    bool unchanged = false;                    // nothing but the revision asked for
    std::shared_ptr<const std::string> bytes;  // a serialized GetLiveResponse
  };
  // INVALID_ARGUMENT: the rig's name is not valid; UNIMPLEMENTED: there is no tracker.
  absl::StatusOr<Answer> Get(const v1::GetLiveRequest& request);
  // The revision of its answer, which costs next to nothing; empty: Get says why.
  std::string Revision(const v1::GetLiveRequest& request) const;

 private:
  struct Cached {
    std::shared_ptr<const LiveSnapshot> state;
    std::map<std::string, Answer, std::less<>> by_since;
  };
  const LiveTracker* const tracker_;
  std::mutex mutex_;
  std::map<std::string, Cached, std::less<>> by_rig_;
};

}  // namespace rigcal::server
