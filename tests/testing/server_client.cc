// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/server_client.h"

#include <grpcpp/grpcpp.h>

#include <chrono>
#include <utility>

#include "common/status/status_macros.h"
#include "common/wire/grpc_status.h"
#include "common/wire/observation_wire.h"
#include "common/wire/time_wire.h"

namespace rigcal::testing {
namespace {

void SetDeadline(grpc::ClientContext* context, int seconds = 60) {
  context->set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(seconds));
}

}  // namespace

ServerClient::ServerClient(const std::string& address)
    : ServerClient(grpc::CreateChannel(address, grpc::InsecureChannelCredentials())) {}

ServerClient::ServerClient(std::shared_ptr<grpc::Channel> channel)
    : channel_(std::move(channel)),
      ingest_(v1::IngestService::NewStub(channel_)),
      agents_(v1::AgentService::NewStub(channel_)),
      sessions_(v1::SessionService::NewStub(channel_)),
      calibrations_(v1::CalibrationService::NewStub(channel_)) {}

absl::StatusOr<v1::Session> ServerClient::CreateSession(const v1::CreateSessionRequest& request) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::CreateSessionResponse response;
  RIGCAL_RETURN_IF_ERROR(wire::FromGrpc(sessions_->CreateSession(&context, request, &response)));
  return response.session();
}

absl::StatusOr<v1::Session> ServerClient::StartSession(const std::string& id) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::StartSessionRequest request;
  request.set_id(id);
  v1::StartSessionResponse response;
  RIGCAL_RETURN_IF_ERROR(wire::FromGrpc(sessions_->StartSession(&context, request, &response)));
  return response.session();
}

absl::StatusOr<v1::Session> ServerClient::StopSession(const std::string& id,
                                                      double drain_timeout_s) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::StopSessionRequest request;
  request.set_id(id);
  *request.mutable_drain_timeout() = wire::ToDuration(drain_timeout_s);
  v1::StopSessionResponse response;
  RIGCAL_RETURN_IF_ERROR(wire::FromGrpc(sessions_->StopSession(&context, request, &response)));
  return response.session();
}

absl::StatusOr<v1::Session> ServerClient::GetSession(const std::string& id) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::GetSessionRequest request;
  request.set_id(id);
  v1::GetSessionResponse response;
  RIGCAL_RETURN_IF_ERROR(wire::FromGrpc(sessions_->GetSession(&context, request, &response)));
  return response.session();
}

absl::StatusOr<v1::BatchAck> ServerClient::Upload(const ObservationBatch& batch) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::UploadBatchRequest request;
  wire::ToProto(batch, request.mutable_batch());
  v1::UploadBatchResponse response;
  RIGCAL_RETURN_IF_ERROR(wire::FromGrpc(ingest_->UploadBatch(&context, request, &response)));
  return response.ack();
}

absl::StatusOr<v1::BatchAck> ServerClient::UploadEnd(const std::string& session,
                                                     const std::string& camera,
                                                     uint32_t stream_epoch, uint32_t last_seq) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::UploadBatchRequest request;
  v1::EndOfCapture* end = request.mutable_end_of_capture();
  end->set_session_id(session);
  end->set_camera(camera);
  end->set_stream_epoch(stream_epoch);
  end->set_last_seq(last_seq);
  v1::UploadBatchResponse response;
  RIGCAL_RETURN_IF_ERROR(wire::FromGrpc(ingest_->UploadBatch(&context, request, &response)));
  return response.ack();
}

absl::StatusOr<std::vector<v1::Agent>> ServerClient::ListAgents() {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::ListAgentsResponse response;
  RIGCAL_RETURN_IF_ERROR(wire::FromGrpc(agents_->ListAgents(&context, {}, &response)));
  return std::vector<v1::Agent>(response.agents().begin(), response.agents().end());
}

absl::StatusOr<v1::Session> ServerClient::WaitUntilFinished(const std::string& id) {
  grpc::ClientContext context;
  SetDeadline(&context, 100);
  v1::WatchSessionRequest request;
  request.set_id(id);
  const auto reader = sessions_->WatchSession(&context, request);
  v1::WatchSessionResponse response;
  while (reader->Read(&response)) {
  }
  RIGCAL_RETURN_IF_ERROR(wire::FromGrpc(reader->Finish()));
  return response.session();
}

absl::StatusOr<v1::Calibration> ServerClient::Calibrate(const std::string& session, int limit_s) {
  RIGCAL_ASSIGN_OR_RETURN(const v1::Calibration created, CreateCalibration(session));
  grpc::ClientContext context;
  SetDeadline(&context, limit_s);
  v1::WatchCalibrationRequest request;
  request.set_id(created.id());
  const auto reader = calibrations_->WatchCalibration(&context, request);
  v1::WatchCalibrationResponse response;
  while (reader->Read(&response)) {
  }
  RIGCAL_RETURN_IF_ERROR(wire::FromGrpc(reader->Finish()));
  return response.calibration();
}

absl::StatusOr<v1::Calibration> ServerClient::CreateCalibration(const std::string& session) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::CreateCalibrationRequest request;
  request.add_session_ids(session);
  v1::CreateCalibrationResponse response;
  RIGCAL_RETURN_IF_ERROR(
      wire::FromGrpc(calibrations_->CreateCalibration(&context, request, &response)));
  return response.calibration();
}

absl::StatusOr<v1::Calibration> ServerClient::GetCalibration(const std::string& id) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::GetCalibrationRequest request;
  request.set_id(id);
  v1::GetCalibrationResponse response;
  RIGCAL_RETURN_IF_ERROR(
      wire::FromGrpc(calibrations_->GetCalibration(&context, request, &response)));
  return response.calibration();
}

absl::StatusOr<std::vector<v1::Calibration>> ServerClient::ListCalibrations(
    const std::string& session) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::ListCalibrationsRequest request;
  request.set_filter("session_ids:" + session);
  request.set_order_by("create_time");
  v1::ListCalibrationsResponse response;
  RIGCAL_RETURN_IF_ERROR(
      wire::FromGrpc(calibrations_->ListCalibrations(&context, request, &response)));
  return std::vector<v1::Calibration>(response.calibrations().begin(),
                                      response.calibrations().end());
}

absl::StatusOr<std::vector<ObservationBatch>> ServerClient::ReadObservations(
    const std::string& session) {
  grpc::ClientContext context;
  SetDeadline(&context);
  v1::ReadObservationsRequest request;
  request.set_session_id(session);
  const auto reader = sessions_->ReadObservations(&context, request);
  std::vector<ObservationBatch> batches;
  v1::ReadObservationsResponse response;
  while (reader->Read(&response)) {
    RIGCAL_ASSIGN_OR_RETURN(ObservationBatch batch, wire::FromProto(response.batch()));
    batches.push_back(std::move(batch));
  }
  RIGCAL_RETURN_IF_ERROR(wire::FromGrpc(reader->Finish()));
  return batches;
}

std::vector<ObservationBatch> SingleRows(const ObservationBatch& batch) {
  std::vector<ObservationBatch> rows;
  for (size_t row = 0; row < batch.rows(); ++row) rows.push_back(batch.Slice(row, row + 1));
  return rows;
}

std::string ComparableBytes(v1::Calibration calibration) {
  calibration.clear_id();
  calibration.clear_version();
  calibration.clear_session_ids();
  calibration.clear_run();
  return calibration.SerializeAsString();
}

std::string ComparableBytes(const std::vector<ObservationBatch>& batches) {
  std::string bytes;
  for (const ObservationBatch& batch : batches) {
    for (ObservationBatch& row : SingleRows(batch)) {
      row.stream.session_id = "s";
      v1::ObservationBatch proto;
      wire::ToProto(row, &proto);
      bytes += proto.SerializeAsString();
    }
  }
  return bytes;
}

}  // namespace rigcal::testing
