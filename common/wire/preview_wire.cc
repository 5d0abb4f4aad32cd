// SPDX-License-Identifier: Apache-2.0
#include "common/wire/preview_wire.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"
#include "common/wire/camera_wire.h"
#include "common/wire/time_wire.h"

namespace rigcal::wire {
namespace {

static_assert(static_cast<int>(PreviewStatus::kOk) == v1::PREVIEW_STATUS_OK);
static_assert(static_cast<int>(PreviewStatus::kFailed) == v1::PREVIEW_STATUS_FAILED);
static_assert(static_cast<int>(DetectionOutcome::kWand) == v1::DETECTION_OUTCOME_WAND);
static_assert(static_cast<int>(DetectionOutcome::kSaturated) == v1::DETECTION_OUTCOME_SATURATED);

constexpr size_t kMaxMessageBytes = 1024;

absl::Status PreviewFault(absl::string_view field, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat("preview.", field, ": ", what));
}

absl::StatusOr<PreviewInfo> ParseInfo(const v1::PreviewInfo& proto) {
  if (absl::Status name = ValidateName("camera", proto.camera()); !name.ok()) {
    return PreviewFault("info.camera", name.message());
  }
  if (!v1::DetectionOutcome_IsValid(proto.outcome()) ||
      proto.outcome() == v1::DETECTION_OUTCOME_UNSPECIFIED) {
    return PreviewFault("info.outcome", absl::StrCat(static_cast<int>(proto.outcome()),
                                                     " is not a known outcome of a detection"));
  }
  if (!(proto.confidence() >= 0 && proto.confidence() <= 1)) {
    return PreviewFault("info.confidence",
                        absl::StrCat(proto.confidence(), " is not within 0 to 1"));
  }
  PreviewInfo info;
  info.camera = proto.camera();
  info.time_ns = proto.time_ns();
  info.clock_epoch = proto.clock_epoch();
  info.image_size_px = FromProto(proto.image_size_px());
  info.jpeg_size_px = FromProto(proto.jpeg_size_px());
  info.outcome = static_cast<DetectionOutcome>(proto.outcome());
  info.confidence = proto.confidence();
  info.visible_marker_count = proto.visible_marker_count();
  info.blob_count = proto.blob_count();
  info.tracked = proto.tracked();
  return info;
}

}  // namespace

v1::PreviewRequest ToProto(const PreviewRequest& request) {
  v1::PreviewRequest proto;
  proto.set_request_id(request.request_id);
  proto.set_camera(request.camera);
  proto.set_max_jpeg_bytes(request.max_jpeg_bytes);
  *proto.mutable_max_wait() = ToDuration(1e-3 * request.max_wait_ms);
  return proto;
}

absl::StatusOr<PreviewRequest> FromProto(const v1::PreviewRequest& proto) {
  if (proto.request_id() == 0) {
    return absl::InvalidArgumentError("preview_request.request_id: must be at least 1");
  }
  if (absl::Status name = ValidateName("camera", proto.camera()); !name.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("preview_request.camera: ", name.message()));
  }
  RIGCAL_ASSIGN_OR_RETURN(const uint32_t max_wait_ms,
                          MillisecondsOf(proto.max_wait(), "preview_request.max_wait"));
  return PreviewRequest{proto.request_id(), proto.camera(), proto.max_jpeg_bytes(), max_wait_ms};
}

v1::PreviewInfo ToProto(const PreviewInfo& info, size_t jpeg_bytes) {
  v1::PreviewInfo proto;
  proto.set_camera(info.camera);
  proto.set_time_ns(info.time_ns);
  proto.set_clock_epoch(info.clock_epoch);
  *proto.mutable_image_size_px() = ToProto(info.image_size_px);
  *proto.mutable_jpeg_size_px() = ToProto(info.jpeg_size_px);
  proto.set_jpeg_bytes(static_cast<uint32_t>(jpeg_bytes));
  proto.set_outcome(static_cast<v1::DetectionOutcome>(info.outcome));
  proto.set_confidence(info.confidence);
  proto.set_visible_marker_count(info.visible_marker_count);
  proto.set_blob_count(info.blob_count);
  proto.set_tracked(info.tracked);
  return proto;
}

v1::Preview ToProto(Preview preview) {
  v1::Preview proto;
  proto.set_request_id(preview.request_id);
  proto.set_status(static_cast<v1::PreviewStatus>(preview.status));
  proto.set_message(std::move(preview.message));
  if (preview.status != PreviewStatus::kOk) return proto;
  *proto.mutable_info() = ToProto(preview.info, preview.jpeg.size());
  proto.set_jpeg(std::move(preview.jpeg));
  return proto;
}

absl::StatusOr<Preview> FromProto(v1::Preview proto) {
  if (proto.request_id() == 0) return PreviewFault("request_id", "must be at least 1");
  Preview preview;
  preview.request_id = proto.request_id();
  // A newer agent may have a status that is not known here; its message explains it.
  const bool known =
      v1::PreviewStatus_IsValid(proto.status()) && proto.status() != v1::PREVIEW_STATUS_UNSPECIFIED;
  preview.status = known ? static_cast<PreviewStatus>(proto.status()) : PreviewStatus::kFailed;
  preview.message = std::move(*proto.mutable_message());
  preview.message.resize(std::min(preview.message.size(), kMaxMessageBytes));
  if (preview.status != PreviewStatus::kOk) return preview;
  RIGCAL_ASSIGN_OR_RETURN(preview.info, ParseInfo(proto.info()));
  if (proto.jpeg().empty() || proto.jpeg().size() > kMaxPreviewBytes) {
    return PreviewFault("jpeg", absl::StrCat("has ", proto.jpeg().size(),
                                             " bytes, it must have 1 to ", kMaxPreviewBytes));
  }
  preview.jpeg = std::move(*proto.mutable_jpeg());
  return preview;
}

}  // namespace rigcal::wire
