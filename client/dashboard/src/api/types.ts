// SPDX-License-Identifier: Apache-2.0
// Made by proto_types.mjs from proto/rigcal/v1; do not edit. `npm run types` makes it anew.

export interface Agent {
  agent_id?: string;
  host?: string;
  rig?: string;
  incarnation?: number;
  connection?: number;
  software_version?: string;
  connected?: boolean;
  connect_time?: string;
  disconnect_time?: string;
  cameras?: CameraDescription[];
  spool?: SpoolStatus;
}

export interface ListAgentsRequest {
  filter?: string;
  order_by?: string;
  page_size?: number;
  page_token?: string;
}

export interface ListAgentsResponse {
  agents?: Agent[];
  next_page_token?: string;
}

export interface Calibration {
  id?: string;
  rig?: string;
  version?: number;
  session_ids?: string[];
  state?: Calibration_State;
  error?: string;
  progress?: CalibrationProgress;
  options?: CalibrationOptions;
  scale_known?: boolean;
  unit_camera?: string;
  reference_camera?: string;
  instant_count?: number;
  cameras?: CalibratedCamera[];
  target?: CalibratedTarget;
  refused?: RefusalCount[];
  findings?: Finding[];
  observation_digest?: string;
  quality?: Quality;
  wand_volume?: WandVolume;
  run?: CalibrationRun;
  damage?: string;
}

export type Calibration_State =
  | 'STATE_UNSPECIFIED'
  | 'STATE_QUEUED'
  | 'STATE_RUNNING'
  | 'STATE_SUCCEEDED'
  | 'STATE_FAILED';

export interface WandVolume {
  min_m?: Vector3;
  max_m?: Vector3;
}

export type CalibrationStage =
  | 'CALIBRATION_STAGE_UNSPECIFIED'
  | 'CALIBRATION_STAGE_READING'
  | 'CALIBRATION_STAGE_ASSOCIATING'
  | 'CALIBRATION_STAGE_SEARCHING_TIME_OFFSETS'
  | 'CALIBRATION_STAGE_INITIALIZING'
  | 'CALIBRATION_STAGE_ADJUSTING'
  | 'CALIBRATION_STAGE_CHOOSING_INTRINSICS'
  | 'CALIBRATION_STAGE_EVALUATING'
  | 'CALIBRATION_STAGE_REPORTING';

export interface CalibrationProgress {
  stage?: CalibrationStage;
  fraction?: number;
}

export interface CalibrationRun {
  create_time?: string;
  start_time?: string;
  end_time?: string;
  solve_duration?: string;
  software_version?: string;
  iteration_count?: number;
}

export interface CalibrationOptions {
  reference_camera?: string;
  intrinsics?: CalibrationOptions_Estimate;
  time_offsets?: CalibrationOptions_Estimate;
  marker_positions?: CalibrationOptions_Estimate;
  sigma_px?: number;
  association_tolerance_s?: number;
  seed?: number;
  known_distance?: KnownDistance;
  accept_m?: number;
}

export type CalibrationOptions_Estimate =
  | 'ESTIMATE_UNSPECIFIED'
  | 'ESTIMATE_FIXED'
  | 'ESTIMATE_REFINED'
  | 'ESTIMATE_AUTO';

export interface KnownDistance {
  camera_a?: string;
  camera_b?: string;
  distance_m?: number;
  sigma_m?: number;
}

export interface CalibratedCamera {
  camera?: string;
  image_size_px?: ImageSize;
  cam_from_rig?: RigidTransform;
  intrinsics?: Intrinsics;
  intrinsics_refined?: boolean;
  clock_id?: string;
  time_offset_s?: number;
  time_rate_ppm?: number;
  time_epoch_s?: number;
  time_offset_estimated?: boolean;
  residuals?: Residuals;
  uncertainty?: CameraUncertainty;
  held_out?: ErrorFigures;
  leave_one_out?: ErrorFigures;
  observation_count?: number;
  wand_count?: number;
}

export interface ErrorFigures {
  mean_px?: number;
  rms_px?: number;
  median_px?: number;
  p95_px?: number;
  marker_count?: number;
}

export interface Residuals {
  all?: ErrorFigures;
  inlier?: ErrorFigures;
  observation_count?: number;
  outlier_count?: number;
}

export interface CameraUncertainty {
  rotation_sigma_rad?: Vector3;
  position_sigma_m?: Vector3;
  time_offset_sigma_s?: number;
  time_rate_sigma_ppm?: number;
  intrinsics_sigma?: number[];
}

export interface CalibratedTarget {
  given?: Target;
  marker_positions_m?: number[];
  marker_positions_estimated?: boolean;
  marker_position_sigma_m?: number[];
  scale_sigma_rel?: number;
  length_error_rms_m?: number;
  spans?: SpanError[];
}

export interface SpanError {
  length_m?: number;
  mean_error_m?: number;
  error_rms_m?: number;
  count?: number;
  held_out_error_rms_m?: number;
  held_out_count?: number;
}

export interface Quality {
  grade?: Quality_Grade;
  reasons?: string[];
  predicted_error_m?: number;
  accepted_error_m?: number;
}

export type Quality_Grade =
  | 'GRADE_UNSPECIFIED'
  | 'GRADE_GOOD'
  | 'GRADE_USABLE'
  | 'GRADE_BAD';

export interface CreateCalibrationRequest {
  session_ids?: string[];
  options?: CalibrationOptions;
}

export interface CreateCalibrationResponse {
  calibration?: Calibration;
}

export interface GetCalibrationRequest {
  id?: string;
}

export interface GetCalibrationResponse {
  calibration?: Calibration;
}

export interface ListCalibrationsRequest {
  filter?: string;
  order_by?: string;
  page_size?: number;
  page_token?: string;
}

export interface ListCalibrationsResponse {
  calibrations?: Calibration[];
  next_page_token?: string;
}

export interface CancelCalibrationRequest {
  id?: string;
}

export interface CancelCalibrationResponse {
  calibration?: Calibration;
}

export interface DeleteCalibrationRequest {
  id?: string;
}

export interface DeleteCalibrationResponse {
}

export interface WatchCalibrationRequest {
  id?: string;
}

export interface WatchCalibrationResponse {
  calibration?: Calibration;
}

export interface GetAccuracyRequest {
  id?: string;
  points_m?: Vector3[];
  grid_step_m?: number;
  sigma_px?: number;
}

export interface GetAccuracyResponse {
  id?: string;
  sigma_px?: number;
  grid_step_m?: number;
  scale_sigma_rel?: number;
  points?: PointAccuracy[];
  grid?: PointAccuracy[];
  shape?: AccuracySummary;
  with_scale?: AccuracySummary;
}

export interface PointAccuracy {
  point_m?: Vector3;
  camera_count?: number;
  noise_sigma_m?: Vector3;
  shape_sigma_m?: Vector3;
  sigma_m?: Vector3;
  shape_total_m?: number;
  total_m?: number;
}

export interface AccuracySummary {
  count?: number;
  median_m?: number;
  p95_m?: number;
  worst_m?: number;
  worst_point_m?: Vector3;
}

export interface ImageSize {
  width?: number;
  height?: number;
}

export interface Intrinsics {
  model?: Intrinsics_Model;
  fx_px?: number;
  fy_px?: number;
  cx_px?: number;
  cy_px?: number;
  distortion?: number[];
}

export type Intrinsics_Model =
  | 'MODEL_UNSPECIFIED'
  | 'MODEL_BROWN_CONRADY'
  | 'MODEL_RATIONAL'
  | 'MODEL_FISHEYE';

export interface CameraSettings {
  model?: string;
  pixel_format?: string;
  exposure_s?: number;
  gain_db?: number;
  frame_rate_hz?: number;
  trigger?: string;
  ptp?: boolean;
}

export interface CameraDescription {
  camera?: string;
  image_size_px?: ImageSize;
  intrinsics?: Intrinsics;
  clock?: Clock;
  latency_s?: number;
  sensor?: CameraDescription_Sensor;
  source?: string;
  settings?: CameraSettings;
}

export type CameraDescription_Sensor =
  | 'SENSOR_UNSPECIFIED'
  | 'SENSOR_FRAME'
  | 'SENSOR_EVENT';

export interface GetPreviewRequest {
  rig?: string;
  camera?: string;
  max_wait?: string;
}

export interface MoveCameraRequest {
  rig?: string;
  camera?: string;
  agent_id?: string;
}

export interface MoveCameraResponse {
  rig?: string;
  camera?: string;
  agent_id?: string;
  previous_agent_id?: string;
}

export interface GetPreviewResponse {
  agent_id?: string;
  rig?: string;
  info?: PreviewInfo;
  jpeg?: string;
}

export interface GetDetectorRequest {
  rig?: string;
  camera?: string;
}

export interface GetDetectorResponse {
  agent_id?: string;
  rig?: string;
  detector?: Detector;
}

export interface LearnMaskRequest {
  rig?: string;
  camera?: string;
  frame_count?: number;
}

export interface LearnMaskResponse {
  agent_id?: string;
  rig?: string;
  detector?: Detector;
}

export interface ClearMaskRequest {
  rig?: string;
  camera?: string;
}

export interface ClearMaskResponse {
  agent_id?: string;
  rig?: string;
  detector?: Detector;
}

export interface TuneDetectorRequest {
  rig?: string;
  camera?: string;
  frame_count?: number;
}

export interface TuneDetectorResponse {
  agent_id?: string;
  rig?: string;
  detector?: Detector;
}

export interface SetDetectorColourRequest {
  rig?: string;
  camera?: string;
  colour?: ColourRange;
}

export interface SetDetectorColourResponse {
  agent_id?: string;
  rig?: string;
  detector?: Detector;
}

export interface ColourRange {
  hue_min_deg?: number;
  hue_max_deg?: number;
  saturation_min?: number;
  value_min?: number;
  washed_out_min?: number;
}

export interface Detector {
  colour?: ColourRange;
  colour_learnt?: boolean;
  mask_learnt?: boolean;
  ignored_pixel_count?: number;
  ignored_share?: number;
  learning?: DetectorLearning;
}

export interface DetectorLearning {
  kind?: DetectorLearning_Kind;
  state?: DetectorLearning_State;
  frame_count?: number;
  wanted_frame_count?: number;
  wand_count?: number;
  message?: string;
}

export type DetectorLearning_Kind =
  | 'KIND_UNSPECIFIED'
  | 'KIND_MASK'
  | 'KIND_COLOUR';

export type DetectorLearning_State =
  | 'STATE_UNSPECIFIED'
  | 'STATE_RUNNING'
  | 'STATE_SUCCEEDED'
  | 'STATE_FAILED';

export type DetectorCommand =
  | 'DETECTOR_COMMAND_UNSPECIFIED'
  | 'DETECTOR_COMMAND_GET'
  | 'DETECTOR_COMMAND_LEARN_MASK'
  | 'DETECTOR_COMMAND_CLEAR_MASK'
  | 'DETECTOR_COMMAND_TUNE'
  | 'DETECTOR_COMMAND_SET_COLOUR';

export interface DetectorRequest {
  request_id?: number;
  camera?: string;
  command?: DetectorCommand;
  frame_count?: number;
  colour?: ColourRange;
}

export type DetectorStatus =
  | 'DETECTOR_STATUS_UNSPECIFIED'
  | 'DETECTOR_STATUS_OK'
  | 'DETECTOR_STATUS_UNKNOWN_CAMERA'
  | 'DETECTOR_STATUS_REFUSED'
  | 'DETECTOR_STATUS_INVALID'
  | 'DETECTOR_STATUS_FAILED';

export interface DetectorAnswer {
  request_id?: number;
  status?: DetectorStatus;
  message?: string;
  detector?: Detector;
}

export type FindingKind =
  | 'FINDING_KIND_UNSPECIFIED'
  | 'FINDING_KIND_CLOCK_OFFSET'
  | 'FINDING_KIND_WRONG_INTRINSICS'
  | 'FINDING_KIND_CAMERA_MOVED'
  | 'FINDING_KIND_ROLLING_SHUTTER'
  | 'FINDING_KIND_FLIPPED_LABELS'
  | 'FINDING_KIND_WRONG_WAND_LENGTH'
  | 'FINDING_KIND_EDGE_COVERAGE'
  | 'FINDING_KIND_WEAK_LINK'
  | 'FINDING_KIND_NARROW_BASELINE'
  | 'FINDING_KIND_LOOSE_POSE'
  | 'FINDING_KIND_INTRINSICS_KEPT'
  | 'FINDING_KIND_INTRINSICS_REFINED'
  | 'FINDING_KIND_TIME_MATCH_CORRECTED'
  | 'FINDING_KIND_RESTARTED'
  | 'FINDING_KIND_NOT_EVALUATED'
  | 'FINDING_KIND_TOO_LITTLE_DATA'
  | 'FINDING_KIND_CLOCK_JUMP'
  | 'FINDING_KIND_CLOCK_DRIFT'
  | 'FINDING_KIND_OUTLIERS_IN_SPAN'
  | 'FINDING_KIND_NOISY_CAMERA'
  | 'FINDING_KIND_MIRRORED_IMAGE'
  | 'FINDING_KIND_INCONSISTENT_CAMERA';

export type FindingSeverity =
  | 'FINDING_SEVERITY_UNSPECIFIED'
  | 'FINDING_SEVERITY_INFO'
  | 'FINDING_SEVERITY_WARNING'
  | 'FINDING_SEVERITY_ERROR';

export interface Finding {
  kind?: FindingKind;
  severity?: FindingSeverity;
  camera?: string;
  value?: number;
  unit?: string;
  advice?: string;
  candidate?: boolean;
}

export interface Vector3 {
  x?: number;
  y?: number;
  z?: number;
}

export interface Quaternion {
  w?: number;
  x?: number;
  y?: number;
  z?: number;
}

export interface RigidTransform {
  rotation?: Quaternion;
  translation_m?: Vector3;
}

export type Role =
  | 'ROLE_UNSPECIFIED'
  | 'ROLE_AGENT'
  | 'ROLE_OPERATOR'
  | 'ROLE_VIEWER'
  | 'ROLE_ADMIN';

export interface Token {
  id?: string;
  role?: Role;
  name?: string;
  create_time?: string;
  expire_time?: string;
  revoked?: boolean;
  use_time?: string;
  used_by?: string;
}

export interface Identity {
  uri?: string;
  name?: string;
  role?: Role;
  join_time?: string;
  expire_time?: string;
  revoke_time?: string;
}

export interface CreateTokenRequest {
  role?: Role;
  ttl?: string;
  name?: string;
}

export interface CreateTokenResponse {
  token?: Token;
  join_string?: string;
}

export interface ListTokensRequest {
}

export interface ListTokensResponse {
  tokens?: Token[];
}

export interface RevokeTokenRequest {
  id?: string;
}

export interface RevokeTokenResponse {
}

export interface ListIdentitiesRequest {
}

export interface ListIdentitiesResponse {
  identities?: Identity[];
}

export interface RevokeRequest {
  uri?: string;
}

export interface RevokeResponse {
}

export interface LiveCamera {
  camera?: string;
  agent_id?: string;
  state?: LiveCamera_State;
  image_size_px?: ImageSize;
  observation_rate_hz?: number;
  wand_rate_hz?: number;
  observation_count?: string;
  wand_count?: string;
  backlog_count?: string;
  dropped_count?: string;
  clock?: LiveClock;
  coverage?: LiveCoverage;
  trail?: LiveTrailPoint[];
  shared_instant_count?: number;
  shared_instant_goal?: number;
  reprojection_rms_px?: number;
  has_preview?: boolean;
}

export type LiveCamera_State =
  | 'STATE_UNSPECIFIED'
  | 'STATE_OFFLINE'
  | 'STATE_IDLE'
  | 'STATE_CAPTURING'
  | 'STATE_ENDED';

export interface LiveClock {
  time_offset_s?: number;
  time_offset_sigma_s?: number;
  sample_spread_s?: number;
  clock_epoch_count?: number;
}

export interface LiveCoverage {
  columns?: number;
  rows?: number;
  counts?: string;
  covered_share?: number;
}

export interface LiveTrailPoint {
  age_ms?: number;
  x0_px?: number;
  y0_px?: number;
  x1_px?: number;
  y1_px?: number;
}

export interface LiveOverlap {
  cameras?: string[];
  counts?: number[];
}

export interface LiveEstimate {
  state?: LiveEstimate_State;
  time?: string;
  problem?: string;
  needs?: LivePairNeed[];
  instant_count?: number;
  solve_duration_s?: number;
  scale_known?: boolean;
  cameras?: LiveEstimatedCamera[];
  marker_positions_m?: number[];
  volume?: LiveVolume;
  history?: LiveFigure[];
  held_out?: LiveHeldOut;
  advice?: LiveAdvice[];
  wand_m?: Vector3[];
  intrinsics_refined?: boolean;
}

export type LiveEstimate_State =
  | 'STATE_UNSPECIFIED'
  | 'STATE_WAITING'
  | 'STATE_READY'
  | 'STATE_FAILED';

export interface LivePairNeed {
  camera_a?: string;
  camera_b?: string;
  common_count?: number;
  needed_count?: number;
}

export interface LiveEstimatedCamera {
  camera?: string;
  cam_from_rig?: RigidTransform;
  time_offset_s?: number;
  time_offset_sigma_s?: number;
  reprojection_rms_px?: number;
  focal_length_px?: number;
  lens_disagrees?: boolean;
}

export interface LiveVolume {
  origin_m?: Vector3;
  step_m?: number;
  count_x?: number;
  count_y?: number;
  count_z?: number;
  sigma_mm?: number[];
  wand_counts?: number[];
  median_mm?: number;
  p95_mm?: number;
  worst_mm?: number;
  worst_point_m?: Vector3;
  scale_sigma_rel?: number;
}

export interface LiveFigure {
  time_s?: number;
  p95_mm?: number;
}

export interface LiveHeldOut {
  rms_px?: number;
  expected_rms_px?: number;
  agrees?: boolean;
}

export interface LiveAdvice {
  text?: string;
  point_m?: Vector3;
  cameras?: string[];
  expected_p95_mm?: number;
}

export interface LiveAlert {
  kind?: string;
  severity?: LiveAlert_Severity;
  camera?: string;
  text?: string;
  since?: string;
}

export type LiveAlert_Severity =
  | 'SEVERITY_UNSPECIFIED'
  | 'SEVERITY_INFO'
  | 'SEVERITY_WARNING'
  | 'SEVERITY_ERROR';

export interface LiveAlerts {
  alerts?: LiveAlert[];
}

export interface LiveAgent {
  agent_id?: string;
  host?: string;
  connected?: boolean;
  spool_rows?: string;
  spool_bytes?: string;
  spool_limit_bytes?: string;
  software_version?: string;
}

export interface LiveAgents {
  agents?: LiveAgent[];
}

export interface LiveState {
  revision?: string;
  full?: boolean;
  time?: string;
  rig?: string;
  session?: Session;
  cameras?: LiveCamera[];
  removed_cameras?: string[];
  overlap?: LiveOverlap;
  estimate?: LiveEstimate;
  alerts?: LiveAlerts;
  agents?: LiveAgents;
  age_s?: number;
  goal?: LiveGoal;
}

export interface LiveGoal {
  until_mm?: number;
  now_mm?: number;
  reached?: boolean;
  why_not?: string;
}

export interface GetLiveRequest {
  rig?: string;
  since_revision?: string;
}

export interface GetLiveResponse {
  live?: LiveState;
}

export type CentreKind =
  | 'CENTRE_KIND_UNSPECIFIED'
  | 'CENTRE_KIND_IMAGE_BLOB'
  | 'CENTRE_KIND_SPHERE_CENTRE';

export interface StreamKey {
  session_id?: string;
  camera?: string;
  stream_epoch?: number;
}

export interface ObservationBatch {
  session_id?: string;
  camera?: string;
  stream_epoch?: number;
  first_seq?: number;
  clock_epoch?: number;
  marker_count?: number;
  time_ns?: string[];
  visible_mask?: number[];
  x_px?: number[];
  y_px?: number[];
  cov_xx_px2?: number[];
  cov_xy_px2?: number[];
  cov_yy_px2?: number[];
  time_delta_ns?: number[];
  label_confidence?: number[];
  centre_kind?: CentreKind[];
  clock_samples?: ClockSample[];
  host_alignments?: HostAlignment[];
  dropped?: DroppedRange[];
}

export interface DroppedRange {
  first_seq?: number;
  count?: number;
  reason?: RefusalReason;
}

export interface FrameCounts {
  received?: string;
  damaged?: string;
  lost?: string;
  reconnects?: string;
}

export type DetectionOutcome =
  | 'DETECTION_OUTCOME_UNSPECIFIED'
  | 'DETECTION_OUTCOME_WAND'
  | 'DETECTION_OUTCOME_NO_BLOB'
  | 'DETECTION_OUTCOME_NO_WAND'
  | 'DETECTION_OUTCOME_AMBIGUOUS'
  | 'DETECTION_OUTCOME_TOO_MANY_BLOBS'
  | 'DETECTION_OUTCOME_BLACK'
  | 'DETECTION_OUTCOME_SATURATED';

export interface DetectionCounts {
  wand?: string;
  no_blob?: string;
  no_wand?: string;
  ambiguous?: string;
  too_many_blobs?: string;
  black?: string;
  saturated?: string;
}

export interface CameraReport {
  session_id?: string;
  camera?: string;
  stream_epoch?: number;
  observation_count?: string;
  refused?: RefusalCount[];
  frames?: FrameCounts;
  detections?: DetectionCounts;
  spool?: SpoolReport;
}

export interface EndOfCapture {
  session_id?: string;
  camera?: string;
  stream_epoch?: number;
  last_seq?: number;
  report?: CameraReport;
}

export interface ObservationFault {
  seq?: number;
  field?: string;
  reason?: RefusalReason;
}

export interface BatchAck {
  session_id?: string;
  camera?: string;
  stream_epoch?: number;
  durable_seq?: number;
  send_limit_seq?: number;
  faults?: ObservationFault[];
  fault_count?: string;
  complete?: boolean;
  conflict_count?: string;
}

export interface PreviewRequest {
  request_id?: number;
  camera?: string;
  max_jpeg_bytes?: number;
  max_wait?: string;
}

export type PreviewStatus =
  | 'PREVIEW_STATUS_UNSPECIFIED'
  | 'PREVIEW_STATUS_OK'
  | 'PREVIEW_STATUS_DISABLED'
  | 'PREVIEW_STATUS_UNKNOWN_CAMERA'
  | 'PREVIEW_STATUS_NO_FRAMES'
  | 'PREVIEW_STATUS_NOT_CAPTURING'
  | 'PREVIEW_STATUS_TOO_OFTEN'
  | 'PREVIEW_STATUS_TIMED_OUT'
  | 'PREVIEW_STATUS_FAILED';

export interface Preview {
  request_id?: number;
  status?: PreviewStatus;
  message?: string;
  info?: PreviewInfo;
  jpeg?: string;
}

export interface PreviewInfo {
  camera?: string;
  time_ns?: string;
  clock_epoch?: number;
  image_size_px?: ImageSize;
  jpeg_size_px?: ImageSize;
  jpeg_bytes?: number;
  outcome?: DetectionOutcome;
  confidence?: number;
  visible_marker_count?: number;
  blob_count?: number;
  tracked?: boolean;
}

export type RefusalReason =
  | 'REFUSAL_REASON_UNSPECIFIED'
  | 'REFUSAL_REASON_IMPLAUSIBLE_TIME'
  | 'REFUSAL_REASON_TIME_NOT_INCREASING'
  | 'REFUSAL_REASON_NOT_FINITE'
  | 'REFUSAL_REASON_FAR_OUTSIDE_IMAGE'
  | 'REFUSAL_REASON_BAD_COVARIANCE'
  | 'REFUSAL_REASON_TIME_DELTA_TOO_LARGE'
  | 'REFUSAL_REASON_BAD_LABEL_CONFIDENCE'
  | 'REFUSAL_REASON_IMPLAUSIBLE_CLOCK_SAMPLE'
  | 'REFUSAL_REASON_LATE'
  | 'REFUSAL_REASON_CSV_BAD_TIME'
  | 'REFUSAL_REASON_CSV_EMPTY'
  | 'REFUSAL_REASON_CSV_FIELD_COUNT'
  | 'REFUSAL_REASON_CSV_HALF_MARKER'
  | 'REFUSAL_REASON_CSV_LINE_TOO_LONG'
  | 'REFUSAL_REASON_CSV_NOT_A_NUMBER'
  | 'REFUSAL_REASON_CSV_NOT_FINITE'
  | 'REFUSAL_REASON_SOURCE_FAILED'
  | 'REFUSAL_REASON_PROTOCOL_FAULT'
  | 'REFUSAL_REASON_SPOOL_FREED'
  | 'REFUSAL_REASON_DUPLICATE_EQUAL'
  | 'REFUSAL_REASON_DUPLICATE_CONFLICT'
  | 'REFUSAL_REASON_VALUE_NOT_FINITE'
  | 'REFUSAL_REASON_COVARIANCE_NOT_POSITIVE'
  | 'REFUSAL_REASON_MARKER_COUNT_MISMATCH'
  | 'REFUSAL_REASON_CLOCK_EPOCH_WITHOUT_OFFSET'
  | 'REFUSAL_REASON_ALONE_IN_INSTANT'
  | 'REFUSAL_REASON_NOT_NEAREST_IN_INSTANT'
  | 'REFUSAL_REASON_INSTANT_WITHOUT_POSE'
  | 'REFUSAL_REASON_LABELS_FLIPPED'
  | 'REFUSAL_REASON_OUTLIER'
  | 'REFUSAL_REASON_FRAME_INCOMPLETE'
  | 'REFUSAL_REASON_FRAME_LOST'
  | 'REFUSAL_REASON_FRAME_NO_BUFFER'
  | 'REFUSAL_REASON_FRAME_WRONG_SIZE'
  | 'REFUSAL_REASON_CAMERA_LOST'
  | 'REFUSAL_REASON_FRAME_NO_TIME'
  | 'REFUSAL_REASON_FRAME_UNREADABLE'
  | 'REFUSAL_REASON_TIMESTAMP_BAD_LINE'
  | 'REFUSAL_REASON_TIMESTAMP_DUPLICATE'
  | 'REFUSAL_REASON_VIDEO_TRUNCATED'
  | 'REFUSAL_REASON_EVENT_UNKNOWN_WORD'
  | 'REFUSAL_REASON_EVENT_OUTSIDE_GEOMETRY'
  | 'REFUSAL_REASON_EVENT_CSV_BAD_LINE'
  | 'REFUSAL_REASON_EVENT_BEFORE_TIME'
  | 'REFUSAL_REASON_EVENT_TRUNCATED_BYTES'
  | 'REFUSAL_REASON_EVENT_DETECTION_WITHOUT_DATA'
  | 'REFUSAL_REASON_EVENT_TRIGGER_TOO_DENSE'
  | 'REFUSAL_REASON_EVENT_DETECTION_OUT_OF_ORDER'
  | 'REFUSAL_REASON_FRAME_BLACK'
  | 'REFUSAL_REASON_FRAME_SATURATED'
  | 'REFUSAL_REASON_TOO_MANY_BLOBS'
  | 'REFUSAL_REASON_MARKER_OCCLUDED'
  | 'REFUSAL_REASON_SPOOL_DAMAGED'
  | 'REFUSAL_REASON_SPOOL_FULL'
  | 'REFUSAL_REASON_SPOOL_FAILED'
  | 'REFUSAL_REASON_DAMAGED_RECORD'
  | 'REFUSAL_REASON_CONFLICT';

export interface RefusalCount {
  camera?: string;
  reason?: RefusalReason;
  count?: number;
  example?: string;
}

export interface Session {
  id?: string;
  rig?: string;
  title?: string;
  state?: Session_State;
  target?: Target;
  cameras?: SessionCamera[];
  create_time?: string;
  start_time?: string;
  stop_time?: string;
  finish_time?: string;
  drain_deadline?: string;
  missing_cameras?: string[];
  observation_count?: string;
  wand_count?: string;
  late_count?: string;
  requested_cameras?: string[];
  camera_count?: number;
  damage?: string;
  observations_delete_time?: string;
  goal?: SessionGoal;
  stop_reason?: string;
  continues?: string;
}

export type Session_State =
  | 'STATE_UNSPECIFIED'
  | 'STATE_CREATED'
  | 'STATE_CAPTURING'
  | 'STATE_DRAINING'
  | 'STATE_FINISHED';

export interface SessionGoal {
  until_mm?: number;
  min_duration?: string;
}

export interface SessionCamera {
  description?: CameraDescription;
  agent_id?: string;
  connected?: boolean;
  observation_count?: string;
  wand_count?: string;
  late_count?: string;
  clock_epochs?: ClockEpochCount[];
  streams?: StreamStatus[];
  refused?: RefusalCount[];
  ended?: boolean;
  frames?: FrameCounts;
  detections?: DetectionCounts;
  conflict_count?: string;
  damaged_count?: string;
}

export interface ClockEpochCount {
  clock_epoch?: number;
  observation_count?: string;
}

export interface StreamStatus {
  stream_epoch?: number;
  durable_seq?: number;
  last_seq?: number;
  ended?: boolean;
}

export interface CreateSessionRequest {
  id?: string;
  rig?: string;
  title?: string;
  target?: Target;
  camera_names?: string[];
  cameras?: CameraDescription[];
  goal?: SessionGoal;
  continues?: string;
}

export interface CreateSessionResponse {
  session?: Session;
}

export interface StartSessionRequest {
  id?: string;
}

export interface StartSessionResponse {
  session?: Session;
}

export interface StopSessionRequest {
  id?: string;
  drain_timeout?: string;
}

export interface StopSessionResponse {
  session?: Session;
}

export interface GetSessionRequest {
  id?: string;
  audit?: boolean;
}

export interface GetSessionResponse {
  session?: Session;
  audit?: StreamAudit[];
}

export interface ListSessionsRequest {
  filter?: string;
  order_by?: string;
  page_size?: number;
  page_token?: string;
}

export interface ListSessionsResponse {
  sessions?: Session[];
  next_page_token?: string;
}

export interface DeleteSessionRequest {
  id?: string;
}

export interface DeleteSessionResponse {
}

export interface WatchSessionRequest {
  id?: string;
}

export interface WatchSessionResponse {
  session?: Session;
}

export interface ReadObservationsRequest {
  session_id?: string;
  camera?: string;
  include_late?: boolean;
}

export interface ReadObservationsResponse {
  batch?: ObservationBatch;
}

export interface SpoolReport {
  last_seq?: number;
  acknowledged_seq?: number;
  spooled_count?: string;
  dropped?: RefusalCount[];
}

export interface SpoolStatus {
  row_count?: string;
  bytes?: string;
  limit_bytes?: string;
  dropped?: RefusalCount[];
  folder?: string;
  problem?: string;
}

export interface StreamAudit {
  camera?: string;
  stream_epoch?: number;
  agent_id?: string;
  holder?: StreamAudit_Holder;
  durable_seq?: number;
  last_seq?: number;
  ended?: boolean;
  highest_seq?: number;
  stored_count?: string;
  dropped?: RefusalCount[];
  reported?: SpoolReport;
}

export type StreamAudit_Holder =
  | 'HOLDER_UNSPECIFIED'
  | 'HOLDER_CONNECTED'
  | 'HOLDER_AWAY'
  | 'HOLDER_GONE';

export interface GetStatusRequest {
}

export interface GetStatusResponse {
  software_version?: string;
  protocol_version?: ProtocolVersion;
  server_id?: string;
  start_time?: string;
  connected_agent_count?: number;
  session_count?: number;
  capturing_session_count?: number;
  queued_calibration_count?: number;
  ingest?: IngestStatus;
  store?: StoreStatus;
  connections?: ConnectionStatus;
}

export interface IngestStatus {
  stored_observation_count?: string;
  duplicate_observation_count?: string;
  refused_observation_count?: string;
  commit_count?: string;
  queue_bytes?: string;
  queue_limit_bytes?: string;
  problem?: string;
  conflict_observation_count?: string;
}

export interface ConnectionStatus {
  open_count?: number;
  limit?: number;
  accepted_count?: string;
  refused_count?: string;
  deaf?: boolean;
}

export interface StoreStatus {
  kind?: string;
  schema_version?: number;
  size_bytes?: string;
  free_bytes?: string;
  problem?: string;
  unused_bytes?: string;
  reserve_bytes?: string;
  retention?: RetentionStatus;
}

export interface RetentionStatus {
  last_run_time?: string;
  session_count?: string;
  last_session_id?: string;
  kept_session_count?: string;
  problem?: string;
}

export interface Target {
  kind?: Target_Kind;
  marker_positions_m?: number[];
  diameter_m?: number;
  blink_hz?: number[];
  span_tolerance_m?: number;
}

export type Target_Kind =
  | 'KIND_UNSPECIFIED'
  | 'KIND_WAND'
  | 'KIND_POINT';

export interface Clock {
  clock_id?: string;
  timebase?: string;
}

export interface ClockSample {
  device_ns?: string;
  host_monotonic_ns?: string;
  host_utc_ns?: string;
  uncertainty_ns?: number;
}

export interface HostAlignment {
  host_monotonic_ns?: string;
  server_minus_host_ns?: string;
  uncertainty_ns?: number;
}

export interface TimePing {
  host_monotonic_ns?: string;
  spool?: SpoolStatus;
}

export interface TimePong {
  host_monotonic_ns?: string;
  server_utc_ns?: string;
}

export interface ProtocolVersion {
  major?: number;
  minor?: number;
}
