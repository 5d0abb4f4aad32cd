// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "absl/status/statusor.h"
#include "common/session/preview.h"
#include "rigcal/v1/preview.pb.h"

namespace rigcal::wire {

// Larger pictures are refused on both sides.
inline constexpr size_t kMaxPreviewBytes = size_t{1} << 20;

v1::PreviewRequest ToProto(const PreviewRequest& request);
// INVALID_ARGUMENT names the field.
absl::StatusOr<PreviewRequest> FromProto(const v1::PreviewRequest& proto);
v1::PreviewInfo ToProto(const PreviewInfo& info, size_t jpeg_bytes);
v1::Preview ToProto(Preview preview);
// INVALID_ARGUMENT names the field. The picture is moved, not looked into. A long message is cut.
absl::StatusOr<Preview> FromProto(v1::Preview proto);

}  // namespace rigcal::wire
