// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rigcal/v1/live.pb.h"

namespace rigcal::client {

// The live state as a client knows it: the last full one, with what has changed since.
class LiveMirror {
 public:
  // Takes an answer of GetLive. True: something has changed.
  bool Merge(const rigcal::v1::LiveState& answer);
  // Everything; `full` is true once there is something.
  const rigcal::v1::LiveState& state() const { return state_; }

 private:
  rigcal::v1::LiveState state_;
};

}  // namespace rigcal::client
