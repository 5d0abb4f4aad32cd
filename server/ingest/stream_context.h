// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/statusor.h"
#include "common/camera/intrinsics.h"
#include "common/session/stream_key.h"

namespace rigcal::server {

// The camera and target that a stream's values are checked against.
struct StreamContext {
  ImageSize image_size_px;
  int marker_count = 0;
};

// Where ingest asks for it. Thread-safe, never blocks on the disk.
class StreamContextSource {
 public:
  virtual ~StreamContextSource() = default;
  // NOT_FOUND: no such session, or no such camera in it. FAILED_PRECONDITION: not started.
  virtual absl::StatusOr<StreamContext> GetStreamContext(const StreamKey& stream) const = 0;
};

}  // namespace rigcal::server
