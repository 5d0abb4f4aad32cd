// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/session/observation_batch.h"
#include "common/target/observation.h"
#include "rigcal/v1/agent_service.grpc.pb.h"
#include "rigcal/v1/calibration_service.grpc.pb.h"
#include "rigcal/v1/ingest_service.grpc.pb.h"
#include "rigcal/v1/session_service.grpc.pb.h"

namespace rigcal::testing {

// A client of a server's API: creates sessions, delivers without an agent, calibrates, reads back.
class ServerClient {
 public:
  explicit ServerClient(const std::string& address);
  explicit ServerClient(std::shared_ptr<grpc::Channel> channel);

  absl::StatusOr<v1::Session> CreateSession(const v1::CreateSessionRequest& request);
  absl::StatusOr<v1::Session> StartSession(const std::string& id);
  absl::StatusOr<v1::Session> StopSession(const std::string& id, double drain_timeout_s);
  absl::StatusOr<v1::Session> GetSession(const std::string& id);
  absl::StatusOr<v1::BatchAck> Upload(const ObservationBatch& batch);
  absl::StatusOr<v1::BatchAck> UploadEnd(const std::string& session, const std::string& camera,
                                         uint32_t stream_epoch, uint32_t last_seq);
  absl::StatusOr<std::vector<v1::Agent>> ListAgents();
  // Waits until the session is FINISHED.
  absl::StatusOr<v1::Session> WaitUntilFinished(const std::string& id);
  // Creates a calibration and waits until it has succeeded or failed.
  absl::StatusOr<v1::Calibration> Calibrate(const std::string& session, int limit_s = 100);
  // Queues one.
  absl::StatusOr<v1::Calibration> CreateCalibration(const std::string& session);
  absl::StatusOr<v1::Calibration> GetCalibration(const std::string& id);
  // Those made from this session, without their cameras; the oldest first.
  absl::StatusOr<std::vector<v1::Calibration>> ListCalibrations(const std::string& session);
  // All rows of a camera as one batch per (stream_epoch, clock_epoch) run, in the stored order.
  absl::StatusOr<std::vector<ObservationBatch>> ReadObservations(const std::string& session);

 private:
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::IngestService::Stub> ingest_;
  std::unique_ptr<v1::AgentService::Stub> agents_;
  std::unique_ptr<v1::SessionService::Stub> sessions_;
  std::unique_ptr<v1::CalibrationService::Stub> calibrations_;
};

// Each row of a batch as a batch of its own.
std::vector<ObservationBatch> SingleRows(const ObservationBatch& batch);

// Everything on which two calibrations of the same observations must agree, as bytes: all except
// ids, version and `run`.
std::string ComparableBytes(v1::Calibration calibration);
// The same for stored observations: every row with its number.
std::string ComparableBytes(const std::vector<ObservationBatch>& batches);

}  // namespace rigcal::testing
