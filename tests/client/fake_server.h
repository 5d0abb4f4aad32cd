// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/grpcpp.h>

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "rigcal/v1/agent_service.grpc.pb.h"
#include "rigcal/v1/calibration_service.grpc.pb.h"
#include "rigcal/v1/camera_service.grpc.pb.h"
#include "rigcal/v1/lens_service.grpc.pb.h"
#include "rigcal/v1/session_service.grpc.pb.h"
#include "rigcal/v1/status_service.grpc.pb.h"

namespace rigcal::testing {

// A real gRPC server in this process, on a free loopback port, that answers with what a test has
// put into it and notes what it was asked. Sessions and calibrations that do not exist are
// NOT_FOUND, with the id.
class FakeServer {
 public:
  FakeServer();
  ~FakeServer();

  const std::string& address() const { return address_; }
  int port() const { return port_; }
  // Every health question is answered with it; true at the beginning.
  void SetServing(bool serving);

  // Answers of the services; held by `mutex` while a call looks at them.
  std::mutex mutex;
  std::map<std::string, v1::Session> sessions;
  std::map<std::string, v1::Calibration> calibrations;
  std::vector<v1::StreamAudit> audit;  // of any session, where it is asked for
  v1::GetAccuracyResponse accuracy;    // of any calibration that exists
  v1::GetResidualsResponse residuals;  // likewise
  v1::ListAgentsResponse agents;
  v1::GetStatusResponse status;
  v1::GetPreviewResponse preview;
  // Of every call about detectors.
  v1::GetDetectorResponse detector;
  // By camera, of any session.
  std::map<std::string, v1::Lens> lenses;
  std::vector<v1::ObservationBatch> observations;
  // Calls of these methods ("GetSession") end with this status.
  std::map<std::string, grpc::Status> failures;
  // What WatchSession sends, stream by stream; a stream ends with the status after its messages.
  struct Watch {
    std::vector<v1::Session> messages;
    grpc::Status end;
  };
  std::deque<Watch> watches;
  // The same of WatchCalibration; without one it is RESOURCE_EXHAUSTED.
  struct CalibrationWatch {
    std::vector<v1::Calibration> messages;
    grpc::Status end;
  };
  std::deque<CalibrationWatch> calibration_watches;
  // Entries per page of a list, whatever is asked. 0: as asked.
  int page_size = 0;
  // Called with a session or calibration before it is returned by Get, to let it go on.
  std::function<void(v1::Session&)> on_get_session;
  std::function<void(v1::Calibration&)> on_get_calibration;
  std::function<void(v1::Detector&)> on_get_detector;
  std::function<void(v1::Lens&)> on_get_lens;

  // What was asked last.
  v1::CreateSessionRequest created_session;
  v1::StopSessionRequest stopped_session;
  v1::CreateCalibrationRequest created_calibration;
  v1::ReadObservationsRequest read_observations;
  v1::ListCalibrationsRequest listed_calibrations;
  v1::GetAccuracyRequest asked_accuracy;
  v1::GetResidualsRequest asked_residuals;
  v1::GetPreviewRequest asked_preview;
  v1::LearnMaskRequest asked_mask;
  v1::SetDetectorColourRequest asked_colour;

 private:
  class Sessions;
  class Calibrations;
  class Agents;
  class Cameras;
  class Lenses;
  class Status;
  grpc::Status FailureOf(const std::string& method);

  std::unique_ptr<Sessions> session_service_;
  std::unique_ptr<Calibrations> calibration_service_;
  std::unique_ptr<Agents> agent_service_;
  std::unique_ptr<Cameras> camera_service_;
  std::unique_ptr<Lenses> lens_service_;
  std::unique_ptr<Status> status_service_;
  std::unique_ptr<grpc::Server> server_;
  int port_ = 0;
  std::string address_;
};

}  // namespace rigcal::testing
