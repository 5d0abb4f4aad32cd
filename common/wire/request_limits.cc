// SPDX-License-Identifier: Apache-2.0
#include "common/wire/request_scan.h"

namespace rigcal::wire {
namespace {

// Names have at most 64 characters (ValidateName); what is too long by a little is refused there,
// in words about names.
constexpr uint32_t kName = 256;
constexpr uint32_t kWord = 1024;  // versions, hosts, camera models
constexpr uint32_t kText = 4096;  // titles, filters, messages
constexpr uint32_t kCameras = 1024;
// Rows of a batch, and markers of all of them: max_batch_rows times the markers of a target.
constexpr uint32_t kRows = 1 << 16;
constexpr uint32_t kMarkers = 1 << 20;

constexpr FieldLimit kLimits[] = {
    {.field = "rigcal.v1.AgentHello.agent_id", .bytes = kName},
    {.field = "rigcal.v1.AgentHello.cameras", .count = kCameras},
    {.field = "rigcal.v1.AgentHello.host", .bytes = kWord},
    {.field = "rigcal.v1.AgentHello.installation_secret", .bytes = kWord},
    {.field = "rigcal.v1.AgentHello.pending", .count = 8192},
    {.field = "rigcal.v1.AgentHello.rig", .bytes = kName},
    {.field = "rigcal.v1.AgentHello.software_version", .bytes = kWord},
    {.field = "rigcal.v1.CalibrationOptions.reference_camera", .bytes = kName},
    {.field = "rigcal.v1.CameraDescription.camera", .bytes = kName},
    {.field = "rigcal.v1.CameraDescription.source", .bytes = kWord},
    {.field = "rigcal.v1.CameraReport.camera", .bytes = kName},
    {.field = "rigcal.v1.CameraReport.refused", .count = 256},
    {.field = "rigcal.v1.CameraReport.session_id", .bytes = kName},
    {.field = "rigcal.v1.CameraSettings.model", .bytes = kWord},
    {.field = "rigcal.v1.CameraSettings.pixel_format", .bytes = kWord},
    {.field = "rigcal.v1.CameraSettings.trigger", .bytes = kWord},
    {.field = "rigcal.v1.CancelCalibrationRequest.id", .bytes = kName},
    {.field = "rigcal.v1.Clock.clock_id", .bytes = kName},
    {.field = "rigcal.v1.Clock.timebase", .bytes = kName},
    {.field = "rigcal.v1.CreateCalibrationRequest.session_ids", .count = 256, .bytes = kName},
    {.field = "rigcal.v1.CreateSessionRequest.camera_names", .count = kCameras, .bytes = kName},
    {.field = "rigcal.v1.CreateSessionRequest.cameras", .count = kCameras},
    {.field = "rigcal.v1.CreateSessionRequest.continues", .bytes = kName},
    {.field = "rigcal.v1.CreateSessionRequest.id", .bytes = kName},
    {.field = "rigcal.v1.CreateSessionRequest.rig", .bytes = kName},
    {.field = "rigcal.v1.CreateSessionRequest.title", .bytes = kText},
    {.field = "rigcal.v1.CreateTokenRequest.name", .bytes = kName},
    {.field = "rigcal.v1.DeleteCalibrationRequest.id", .bytes = kName},
    {.field = "rigcal.v1.DeleteSessionRequest.id", .bytes = kName},
    {.field = "rigcal.v1.EndOfCapture.camera", .bytes = kName},
    {.field = "rigcal.v1.EndOfCapture.session_id", .bytes = kName},
    {.field = "rigcal.v1.GetAccuracyRequest.id", .bytes = kName},
    {.field = "rigcal.v1.GetAccuracyRequest.points_m", .count = 16384},
    {.field = "rigcal.v1.GetCalibrationRequest.id", .bytes = kName},
    {.field = "rigcal.v1.GetLiveRequest.rig", .bytes = kName},
    {.field = "rigcal.v1.GetLiveRequest.since_revision", .bytes = kName},
    {.field = "rigcal.v1.GetPreviewRequest.camera", .bytes = kName},
    {.field = "rigcal.v1.GetPreviewRequest.rig", .bytes = kName},
    {.field = "rigcal.v1.GetSessionRequest.id", .bytes = kName},
    {.field = "rigcal.v1.Intrinsics.distortion", .count = 64},
    {.field = "rigcal.v1.KnownDistance.camera_a", .bytes = kName},
    {.field = "rigcal.v1.KnownDistance.camera_b", .bytes = kName},
    {.field = "rigcal.v1.ListAgentsRequest.filter", .bytes = kText},
    {.field = "rigcal.v1.ListAgentsRequest.order_by", .bytes = kText},
    {.field = "rigcal.v1.ListAgentsRequest.page_token", .bytes = kText},
    {.field = "rigcal.v1.ListCalibrationsRequest.filter", .bytes = kText},
    {.field = "rigcal.v1.ListCalibrationsRequest.order_by", .bytes = kText},
    {.field = "rigcal.v1.ListCalibrationsRequest.page_token", .bytes = kText},
    {.field = "rigcal.v1.ListSessionsRequest.filter", .bytes = kText},
    {.field = "rigcal.v1.ListSessionsRequest.order_by", .bytes = kText},
    {.field = "rigcal.v1.ListSessionsRequest.page_token", .bytes = kText},
    {.field = "rigcal.v1.MoveCameraRequest.agent_id", .bytes = kName},
    {.field = "rigcal.v1.MoveCameraRequest.camera", .bytes = kName},
    {.field = "rigcal.v1.MoveCameraRequest.rig", .bytes = kName},
    {.field = "rigcal.v1.ObservationBatch.camera", .bytes = kName},
    {.field = "rigcal.v1.ObservationBatch.centre_kind", .count = kMarkers},
    {.field = "rigcal.v1.ObservationBatch.clock_samples", .count = 4096},
    {.field = "rigcal.v1.ObservationBatch.cov_xx_px2", .count = kMarkers},
    {.field = "rigcal.v1.ObservationBatch.cov_xy_px2", .count = kMarkers},
    {.field = "rigcal.v1.ObservationBatch.cov_yy_px2", .count = kMarkers},
    {.field = "rigcal.v1.ObservationBatch.dropped", .count = 4096},
    {.field = "rigcal.v1.ObservationBatch.host_alignments", .count = 4096},
    {.field = "rigcal.v1.ObservationBatch.label_confidence", .count = kMarkers},
    {.field = "rigcal.v1.ObservationBatch.session_id", .bytes = kName},
    {.field = "rigcal.v1.ObservationBatch.time_delta_ns", .count = kMarkers},
    {.field = "rigcal.v1.ObservationBatch.time_ns", .count = kRows},
    {.field = "rigcal.v1.ObservationBatch.visible_mask", .count = kRows},
    {.field = "rigcal.v1.ObservationBatch.x_px", .count = kMarkers},
    {.field = "rigcal.v1.ObservationBatch.y_px", .count = kMarkers},
    {.field = "rigcal.v1.Preview.jpeg", .bytes = 4u << 20},
    {.field = "rigcal.v1.Preview.message", .bytes = kText},
    {.field = "rigcal.v1.PreviewInfo.camera", .bytes = kName},
    {.field = "rigcal.v1.ReadObservationsRequest.camera", .bytes = kName},
    {.field = "rigcal.v1.ReadObservationsRequest.session_id", .bytes = kName},
    {.field = "rigcal.v1.RefusalCount.camera", .bytes = kName},
    {.field = "rigcal.v1.RefusalCount.example", .bytes = kText},
    {.field = "rigcal.v1.RevokeRequest.uri", .bytes = kWord},
    {.field = "rigcal.v1.RevokeTokenRequest.id", .bytes = kName},
    {.field = "rigcal.v1.SpoolReport.dropped", .count = 256},
    {.field = "rigcal.v1.SpoolStatus.dropped", .count = 256},
    {.field = "rigcal.v1.SpoolStatus.folder", .bytes = kText},
    {.field = "rigcal.v1.SpoolStatus.problem", .bytes = kText},
    {.field = "rigcal.v1.StartSessionRequest.id", .bytes = kName},
    {.field = "rigcal.v1.StopSessionRequest.id", .bytes = kName},
    {.field = "rigcal.v1.StreamKey.camera", .bytes = kName},
    {.field = "rigcal.v1.StreamKey.session_id", .bytes = kName},
    {.field = "rigcal.v1.Target.blink_hz", .count = 64},
    {.field = "rigcal.v1.Target.marker_positions_m", .count = 64},
    {.field = "rigcal.v1.UploadBatchRequest.agent_id", .bytes = kName},
    {.field = "rigcal.v1.UploadBatchRequest.installation_secret", .bytes = kWord},
    {.field = "rigcal.v1.WatchCalibrationRequest.id", .bytes = kName},
    {.field = "rigcal.v1.WatchSessionRequest.id", .bytes = kName},
};

}  // namespace

std::span<const FieldLimit> FieldLimits() { return kLimits; }

}  // namespace rigcal::wire
