// SPDX-License-Identifier: Apache-2.0
#include "tests/golden/golden_content.h"

#include <cstdint>
#include <utility>
#include <vector>

#include "common/calibration/calibration.h"
#include "common/session/observation_batch.h"
#include "common/session/session.h"
#include "common/status/status_macros.h"
#include "common/wire/agent_wire.h"
#include "common/wire/camera_wire.h"
#include "common/wire/observation_wire.h"
#include "rigcal/v1/ingest_service.pb.h"

namespace rigcal::testing {
namespace {

CameraDescription GoldenCamera(const std::string& name) {
  CameraDescription camera;
  camera.camera = name;
  camera.image_size_px = {.width = 1280, .height = 1024};
  camera.intrinsics = Intrinsics{.model = DistortionModel::kBrownConrady,
                                 .fx_px = 1000,
                                 .fy_px = 1001,
                                 .cx_px = 640,
                                 .cy_px = 512,
                                 .distortion = {-0.1, 0.01, 0.001, -0.001, 0}};
  camera.clock = {.clock_id = name, .timebase = "recording"};
  return camera;
}

// Values that binary fractions hold exactly. Every fourth row is empty.
Observation GoldenRow(uint32_t seq) {
  Observation row;
  row.time_ns = int64_t{1'000'000} * seq;
  row.markers.resize(3);
  for (size_t i = 0; i < 3; ++i) {
    MarkerObservation& marker = row.markers[i];
    marker.visible = seq % 4 != 0;
    marker.centre_px = {100.25 + seq, 50.5 + 8.0 * static_cast<double>(i)};
    marker.covariance_px2 << 0.0625, 0.0078125, 0.0078125, 0.03125;
    marker.time_delta_ns = static_cast<int32_t>(1000 * i);
    marker.label_confidence = 0.75;
    marker.centre_kind = CentreKind::kSphereCentre;
  }
  return row;
}

ObservationBatch GoldenBatch(const StreamKey& stream, uint32_t first_seq, uint32_t last_seq) {
  ObservationBatch batch;
  batch.stream = stream;
  batch.first_seq = first_seq;
  batch.marker_count = 3;
  for (uint32_t seq = first_seq; seq <= last_seq; ++seq) batch.Append(GoldenRow(seq));
  batch.clock_samples.push_back({.device_ns = int64_t{1000} * first_seq});
  return batch;
}

EndOfCapture GoldenEnd(const StreamKey& stream, uint32_t last_seq) {
  EndOfCapture end;
  end.stream = stream;
  end.last_seq = last_seq;
  end.report.stream = stream;
  end.report.observation_count = last_seq;
  end.report.refused.push_back({stream.camera, RefusalReason::kCsvBadTime, 2, "left.csv:3"});
  return end;
}

v1::AgentHello GoldenHello() {
  v1::AgentHello hello;
  hello.mutable_protocol_version()->set_major(2);
  hello.set_software_version("0.1.0");
  hello.set_agent_id("pc1");
  hello.set_incarnation(3);
  hello.set_connection(1);
  hello.set_host("lab-pc-1");
  hello.set_rig("rig");
  hello.set_installation_secret("secret of pc1");
  hello.set_spool_survives_restart(true);
  v1::AnnouncedCamera* camera = hello.add_cameras();
  *camera->mutable_description() = wire::ToProto(GoldenCamera("left"));
  camera->set_stream_epoch(1);
  *hello.add_pending() = wire::ToProto(StreamKey{"wave", "left", 1});
  return hello;
}

server::Delivery GoldenDelivery(ObservationBatch batch) {
  server::Delivery delivery;
  delivery.batch = std::move(batch);
  return delivery;
}

Session GoldenSession(const std::string& id) {
  Session session;
  session.id = id;
  session.rig = "rig";
  session.title = "The golden wave";
  session.target.marker_positions_m = {0, 0.125, 0.375};
  session.state = SessionState::kCapturing;
  session.cameras.push_back({GoldenCamera("left"), ""});
  session.cameras.push_back({GoldenCamera("right"), "pc1"});
  return session;
}

}  // namespace

std::map<std::string, std::string> GoldenMessages() {
  const StreamKey stream{"wave", "left", 1};
  std::map<std::string, std::string> messages;
  v1::ConnectRequest request;
  *request.mutable_hello() = GoldenHello();
  messages["hello"] = request.SerializeAsString();
  wire::ToProto(GoldenBatch(stream, 1, 6), request.mutable_batch());
  messages["batch"] = request.SerializeAsString();
  const EndOfCapture end = GoldenEnd(stream, 6);
  *request.mutable_report() = wire::ToProto(end.report);
  messages["report"] = request.SerializeAsString();
  *request.mutable_end_of_capture() = wire::ToProto(end);
  messages["end"] = request.SerializeAsString();

  v1::ConnectResponse response;
  v1::ServerHello* hello = response.mutable_hello();
  hello->mutable_protocol_version()->set_major(2);
  hello->set_software_version("0.1.0");
  hello->set_server_id("golden-server");
  hello->set_max_message_bytes(4u << 20);
  hello->set_max_batch_observations(8192);
  messages["server_hello"] = response.SerializeAsString();
  v1::StartCapture* start = response.mutable_start_capture();
  start->set_session_id("wave");
  start->mutable_target()->set_kind(v1::Target::KIND_WAND);
  for (const double position : {0.0, 0.125, 0.375}) {
    start->mutable_target()->add_marker_positions_m(position);
  }
  v1::StreamPosition* position = start->add_cameras();
  *position->mutable_stream() = wire::ToProto(stream);
  position->set_send_limit_seq(32768);
  messages["start"] = response.SerializeAsString();
  v1::BatchAck* ack = response.mutable_ack();
  ack->set_session_id("wave");
  ack->set_camera("left");
  ack->set_stream_epoch(1);
  ack->set_durable_seq(6);
  ack->set_send_limit_seq(32774);
  messages["ack"] = response.SerializeAsString();
  return messages;
}

absl::Status FillGoldenStore(server::Store* store) {
  RIGCAL_RETURN_IF_ERROR(store->CreateSession(GoldenSession("wave")).status());
  RIGCAL_RETURN_IF_ERROR(store->CreateSession(GoldenSession("running")).status());
  std::vector<server::Delivery> deliveries;
  for (const char* camera : {"left", "right"}) {
    for (const char* id : {"wave", "running"}) {
      const StreamKey stream{id, camera, 1};
      deliveries.push_back(GoldenDelivery(GoldenBatch(stream, 1, 40)));
      // Numbers 41 to 50 are dropped, and 61 on comes before 51 to 60.
      server::Delivery later = GoldenDelivery(GoldenBatch(stream, 61, 100));
      later.batch.dropped.push_back(
          {.first_seq = 41, .count = 10, .reason = RefusalReason::kSpoolFull});
      deliveries.push_back(std::move(later));
    }
    server::Delivery last = GoldenDelivery(GoldenBatch({"wave", camera, 1}, 51, 60));
    last.last_seq = 100;
    last.report = GoldenEnd({"wave", camera, 1}, 100).report;
    deliveries.push_back(std::move(last));
  }
  RIGCAL_RETURN_IF_ERROR(store->Append(deliveries).status());
  Session finished = GoldenSession("wave");
  finished.state = SessionState::kFinished;
  RIGCAL_RETURN_IF_ERROR(store->UpdateSession(finished));
  Calibration calibration;
  calibration.rig = "rig";
  calibration.session_ids = {"wave"};
  calibration.state = CalibrationState::kSucceeded;
  calibration.result.emplace();
  calibration.result->reference_camera = "left";
  calibration.result->target.given = finished.target;
  calibration.result->instant_count = 90;
  return store->CreateCalibration(calibration).status();
}

absl::Status FillGoldenSpool(agent::ObservationSpool* spool) {
  const StreamKey ended{"wave", "left", 7}, running{"wave", "right", 7};
  for (const StreamKey& stream : {ended, running}) {
    RIGCAL_RETURN_IF_ERROR(spool->Open(stream, 3, 1));
    for (uint32_t seq = 1; seq <= 30; ++seq) {
      RIGCAL_RETURN_IF_ERROR(
          spool->Append(stream, GoldenRow(seq), {{.device_ns = int64_t{1000} * seq}}).status());
    }
  }
  spool->Acknowledge(running, 12);
  return spool->Finish(ended, GoldenEnd(ended, 30).report);
}

}  // namespace rigcal::testing
