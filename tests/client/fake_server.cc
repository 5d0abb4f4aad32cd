// SPDX-License-Identifier: Apache-2.0
#include "tests/client/fake_server.h"

#include <grpcpp/ext/health_check_service_server_builder_option.h>
#include <grpcpp/health_check_service_interface.h>

#include <stdexcept>
#include <utility>

namespace rigcal::testing {
namespace {

grpc::Status NotFound(const std::string& what, const std::string& id) {
  return grpc::Status(grpc::StatusCode::NOT_FOUND, "there is no " + what + " " + id);
}

// The page that begins at `token`, as [begin, end), and the token of the next one.
template <typename Request>
std::pair<size_t, size_t> Page(const Request& request, int page_size, size_t count,
                               std::string* next) {
  const size_t begin = request.page_token().empty() ? 0 : std::stoul(request.page_token());
  const size_t size = page_size > 0 ? static_cast<size_t>(page_size) : request.page_size();
  const size_t end = std::min(count, begin + size);
  if (end < count) *next = std::to_string(end);
  return {begin, end};
}

}  // namespace

class FakeServer::Sessions : public v1::SessionService::Service {
 public:
  explicit Sessions(FakeServer& fake) : fake_(fake) {}

  grpc::Status CreateSession(grpc::ServerContext*, const v1::CreateSessionRequest* request,
                             v1::CreateSessionResponse* out) override {
    const std::lock_guard lock(fake_.mutex);
    if (auto failure = fake_.FailureOf("CreateSession"); !failure.ok()) return failure;
    v1::Session* response = out->mutable_session();
    fake_.created_session = *request;
    response->set_id(request->id().empty() ? "made" : request->id());
    response->set_rig(request->rig());
    response->set_title(request->title());
    response->set_state(v1::Session::STATE_CREATED);
    *response->mutable_target() = request->target();
    fake_.sessions[response->id()] = *response;
    return grpc::Status::OK;
  }
  grpc::Status StartSession(grpc::ServerContext*, const v1::StartSessionRequest* request,
                            v1::StartSessionResponse* out) override {
    return Change("StartSession", request->id(), v1::Session::STATE_CAPTURING,
                  out->mutable_session());
  }
  grpc::Status StopSession(grpc::ServerContext*, const v1::StopSessionRequest* request,
                           v1::StopSessionResponse* out) override {
    {
      const std::lock_guard lock(fake_.mutex);
      fake_.stopped_session = *request;
    }
    return Change("StopSession", request->id(), v1::Session::STATE_DRAINING,
                  out->mutable_session());
  }
  grpc::Status GetSession(grpc::ServerContext*, const v1::GetSessionRequest* request,
                          v1::GetSessionResponse* out) override {
    const std::lock_guard lock(fake_.mutex);
    if (auto failure = fake_.FailureOf("GetSession"); !failure.ok()) return failure;
    const auto found = fake_.sessions.find(request->id());
    if (found == fake_.sessions.end()) return NotFound("session", request->id());
    if (fake_.on_get_session) fake_.on_get_session(found->second);
    *out->mutable_session() = found->second;
    if (request->audit()) out->mutable_audit()->Assign(fake_.audit.begin(), fake_.audit.end());
    return grpc::Status::OK;
  }
  grpc::Status ListSessions(grpc::ServerContext*, const v1::ListSessionsRequest* request,
                            v1::ListSessionsResponse* response) override {
    const std::lock_guard lock(fake_.mutex);
    if (auto failure = fake_.FailureOf("ListSessions"); !failure.ok()) return failure;
    std::vector<v1::Session> all;
    for (const auto& [id, session] : fake_.sessions) {
      const std::string of_rig = "rig=\"" + session.rig() + "\"";
      if (request->filter().empty() || request->filter() == of_rig) all.push_back(session);
    }
    const auto [begin, end] =
        Page(*request, fake_.page_size, all.size(), response->mutable_next_page_token());
    for (size_t i = begin; i < end; ++i) *response->add_sessions() = all[i];
    return grpc::Status::OK;
  }
  grpc::Status DeleteSession(grpc::ServerContext*, const v1::DeleteSessionRequest* request,
                             v1::DeleteSessionResponse*) override {
    const std::lock_guard lock(fake_.mutex);
    if (fake_.sessions.erase(request->id()) == 0) return NotFound("session", request->id());
    return grpc::Status::OK;
  }
  grpc::Status DiscardSession(grpc::ServerContext*, const v1::DiscardSessionRequest* request,
                              v1::DiscardSessionResponse* out) override {
    const std::lock_guard lock(fake_.mutex);
    const auto found = fake_.sessions.find(request->id());
    if (found == fake_.sessions.end()) return NotFound("session", request->id());
    if (request->undo()) {
      found->second.clear_discard_time();
    } else {
      found->second.mutable_discard_time()->set_seconds(1'790'000'000);
    }
    *out->mutable_session() = found->second;
    return grpc::Status::OK;
  }
  grpc::Status WatchSession(grpc::ServerContext*, const v1::WatchSessionRequest* request,
                            grpc::ServerWriter<v1::WatchSessionResponse>* writer) override {
    Watch watch;
    {
      const std::lock_guard lock(fake_.mutex);
      if (fake_.watches.empty()) return NotFound("session", request->id());
      watch = std::move(fake_.watches.front());
      fake_.watches.pop_front();
    }
    for (const v1::Session& message : watch.messages) {
      v1::WatchSessionResponse response;
      *response.mutable_session() = message;
      writer->Write(response);
    }
    return watch.end;
  }
  grpc::Status ReadObservations(grpc::ServerContext*, const v1::ReadObservationsRequest* request,
                                grpc::ServerWriter<v1::ReadObservationsResponse>* writer) override {
    const std::lock_guard lock(fake_.mutex);
    fake_.read_observations = *request;
    for (const v1::ObservationBatch& batch : fake_.observations) {
      v1::ReadObservationsResponse response;
      *response.mutable_batch() = batch;
      writer->Write(response);
    }
    return fake_.FailureOf("ReadObservations");
  }

 private:
  grpc::Status Change(const std::string& method, const std::string& id, v1::Session::State state,
                      v1::Session* response) {
    const std::lock_guard lock(fake_.mutex);
    if (auto failure = fake_.FailureOf(method); !failure.ok()) return failure;
    const auto found = fake_.sessions.find(id);
    if (found == fake_.sessions.end()) return NotFound("session", id);
    found->second.set_state(state);
    *response = found->second;
    return grpc::Status::OK;
  }

  FakeServer& fake_;
};

class FakeServer::Calibrations : public v1::CalibrationService::Service {
 public:
  explicit Calibrations(FakeServer& fake) : fake_(fake) {}

  grpc::Status CreateCalibration(grpc::ServerContext*, const v1::CreateCalibrationRequest* request,
                                 v1::CreateCalibrationResponse* out) override {
    const std::lock_guard lock(fake_.mutex);
    if (auto failure = fake_.FailureOf("CreateCalibration"); !failure.ok()) return failure;
    fake_.created_calibration = *request;
    v1::Calibration* response = out->mutable_calibration();
    response->set_id("cal-new");
    response->set_state(v1::Calibration::STATE_QUEUED);
    *response->mutable_session_ids() = request->session_ids();
    // What it will become, where a test has said so.
    fake_.calibrations.try_emplace(response->id(), *response);
    return grpc::Status::OK;
  }
  grpc::Status GetCalibration(grpc::ServerContext*, const v1::GetCalibrationRequest* request,
                              v1::GetCalibrationResponse* out) override {
    const std::lock_guard lock(fake_.mutex);
    if (auto failure = fake_.FailureOf("GetCalibration"); !failure.ok()) return failure;
    const auto found = fake_.calibrations.find(request->id());
    if (found == fake_.calibrations.end()) return NotFound("calibration", request->id());
    if (fake_.on_get_calibration) fake_.on_get_calibration(found->second);
    *out->mutable_calibration() = found->second;
    return grpc::Status::OK;
  }
  grpc::Status ListCalibrations(grpc::ServerContext*, const v1::ListCalibrationsRequest* request,
                                v1::ListCalibrationsResponse* response) override {
    const std::lock_guard lock(fake_.mutex);
    fake_.listed_calibrations = *request;
    std::vector<v1::Calibration> all;
    for (const auto& [id, calibration] : fake_.calibrations) all.push_back(calibration);
    const auto [begin, end] =
        Page(*request, fake_.page_size, all.size(), response->mutable_next_page_token());
    for (size_t i = begin; i < end; ++i) *response->add_calibrations() = all[i];
    return grpc::Status::OK;
  }
  grpc::Status CancelCalibration(grpc::ServerContext*, const v1::CancelCalibrationRequest* request,
                                 v1::CancelCalibrationResponse* out) override {
    const std::lock_guard lock(fake_.mutex);
    const auto found = fake_.calibrations.find(request->id());
    if (found == fake_.calibrations.end()) return NotFound("calibration", request->id());
    found->second.set_state(v1::Calibration::STATE_CANCELLED);
    found->second.set_error("cancelled");
    *out->mutable_calibration() = found->second;
    return grpc::Status::OK;
  }
  grpc::Status DeleteCalibration(grpc::ServerContext*, const v1::DeleteCalibrationRequest* request,
                                 v1::DeleteCalibrationResponse*) override {
    const std::lock_guard lock(fake_.mutex);
    if (fake_.calibrations.erase(request->id()) == 0) return NotFound("calibration", request->id());
    return grpc::Status::OK;
  }
  grpc::Status WatchCalibration(grpc::ServerContext*, const v1::WatchCalibrationRequest*,
                                grpc::ServerWriter<v1::WatchCalibrationResponse>* writer) override {
    CalibrationWatch watch;
    {
      const std::lock_guard lock(fake_.mutex);
      if (fake_.calibration_watches.empty()) {
        return grpc::Status(grpc::StatusCode::RESOURCE_EXHAUSTED, "too many clients are watching");
      }
      watch = std::move(fake_.calibration_watches.front());
      fake_.calibration_watches.pop_front();
    }
    for (const v1::Calibration& message : watch.messages) {
      v1::WatchCalibrationResponse response;
      *response.mutable_calibration() = message;
      writer->Write(response);
    }
    return watch.end;
  }
  grpc::Status GetAccuracy(grpc::ServerContext*, const v1::GetAccuracyRequest* request,
                           v1::GetAccuracyResponse* response) override {
    const std::lock_guard lock(fake_.mutex);
    if (!fake_.calibrations.contains(request->id())) {
      return NotFound("calibration", request->id());
    }
    fake_.asked_accuracy = *request;
    *response = fake_.accuracy;
    return grpc::Status::OK;
  }
  grpc::Status GetResiduals(grpc::ServerContext*, const v1::GetResidualsRequest* request,
                            v1::GetResidualsResponse* response) override {
    const std::lock_guard lock(fake_.mutex);
    if (!fake_.calibrations.contains(request->id())) {
      return NotFound("calibration", request->id());
    }
    fake_.asked_residuals = *request;
    *response = fake_.residuals;
    return grpc::Status::OK;
  }

 private:
  FakeServer& fake_;
};

class FakeServer::Status : public v1::StatusService::Service {
 public:
  explicit Status(FakeServer& fake) : fake_(fake) {}

  grpc::Status GetStatus(grpc::ServerContext*, const v1::GetStatusRequest*,
                         v1::GetStatusResponse* response) override {
    const std::lock_guard lock(fake_.mutex);
    *response = fake_.status;
    return fake_.FailureOf("GetStatus");
  }

 private:
  FakeServer& fake_;
};

class FakeServer::Agents : public v1::AgentService::Service {
 public:
  explicit Agents(FakeServer& fake) : fake_(fake) {}

  grpc::Status ListAgents(grpc::ServerContext*, const v1::ListAgentsRequest*,
                          v1::ListAgentsResponse* response) override {
    const std::lock_guard lock(fake_.mutex);
    *response = fake_.agents;
    return fake_.FailureOf("ListAgents");
  }

 private:
  FakeServer& fake_;
};

class FakeServer::Lenses : public v1::LensService::Service {
 public:
  explicit Lenses(FakeServer& fake) : fake_(fake) {}

  grpc::Status GetLens(grpc::ServerContext*, const v1::GetLensRequest* request,
                       v1::GetLensResponse* response) override {
    const std::lock_guard lock(fake_.mutex);
    const auto found = fake_.lenses.find(request->camera());
    if (found == fake_.lenses.end()) {
      return {grpc::StatusCode::NOT_FOUND,
              "session '" + request->session_id() + "' has no camera '" + request->camera() + "'"};
    }
    if (fake_.on_get_lens) fake_.on_get_lens(found->second);
    *response->mutable_lens() = found->second;
    return fake_.FailureOf("GetLens");
  }

 private:
  FakeServer& fake_;
};

class FakeServer::Cameras : public v1::CameraService::Service {
 public:
  explicit Cameras(FakeServer& fake) : fake_(fake) {}

  grpc::Status GetPreview(grpc::ServerContext*, const v1::GetPreviewRequest* request,
                          v1::GetPreviewResponse* response) override {
    const std::lock_guard lock(fake_.mutex);
    fake_.asked_preview = *request;
    *response = fake_.preview;
    return fake_.FailureOf("GetPreview");
  }
  grpc::Status GetDetector(grpc::ServerContext*, const v1::GetDetectorRequest*,
                           v1::GetDetectorResponse* response) override {
    const std::lock_guard lock(fake_.mutex);
    if (fake_.on_get_detector) fake_.on_get_detector(*fake_.detector.mutable_detector());
    *response = fake_.detector;
    return fake_.FailureOf("GetDetector");
  }
  grpc::Status LearnMask(grpc::ServerContext*, const v1::LearnMaskRequest* request,
                         v1::LearnMaskResponse* response) override {
    const std::lock_guard lock(fake_.mutex);
    fake_.asked_mask = *request;
    *response->mutable_detector() = fake_.detector.detector();
    return fake_.FailureOf("LearnMask");
  }
  grpc::Status ClearMask(grpc::ServerContext*, const v1::ClearMaskRequest*,
                         v1::ClearMaskResponse* response) override {
    const std::lock_guard lock(fake_.mutex);
    fake_.detector.mutable_detector()->set_mask_learnt(false);
    *response->mutable_detector() = fake_.detector.detector();
    return fake_.FailureOf("ClearMask");
  }
  grpc::Status TuneDetector(grpc::ServerContext*, const v1::TuneDetectorRequest*,
                            v1::TuneDetectorResponse* response) override {
    const std::lock_guard lock(fake_.mutex);
    *response->mutable_detector() = fake_.detector.detector();
    return fake_.FailureOf("TuneDetector");
  }
  grpc::Status SetDetectorColour(grpc::ServerContext*, const v1::SetDetectorColourRequest* request,
                                 v1::SetDetectorColourResponse* response) override {
    const std::lock_guard lock(fake_.mutex);
    fake_.asked_colour = *request;
    *fake_.detector.mutable_detector()->mutable_colour() = request->colour();
    *response->mutable_detector() = fake_.detector.detector();
    return fake_.FailureOf("SetDetectorColour");
  }

 private:
  FakeServer& fake_;
};

FakeServer::FakeServer()
    : session_service_(std::make_unique<Sessions>(*this)),
      calibration_service_(std::make_unique<Calibrations>(*this)),
      agent_service_(std::make_unique<Agents>(*this)),
      camera_service_(std::make_unique<Cameras>(*this)),
      lens_service_(std::make_unique<Lenses>(*this)),
      status_service_(std::make_unique<Status>(*this)) {
  grpc::EnableDefaultHealthCheckService(true);
  grpc::ServerBuilder builder;
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port_);
  builder.RegisterService(session_service_.get());
  builder.RegisterService(calibration_service_.get());
  builder.RegisterService(agent_service_.get());
  builder.RegisterService(camera_service_.get());
  builder.RegisterService(lens_service_.get());
  builder.RegisterService(status_service_.get());
  server_ = builder.BuildAndStart();
  if (server_ == nullptr) throw std::runtime_error("the fake server does not start");
  SetServing(true);
  address_ = "127.0.0.1:" + std::to_string(port_);
}

FakeServer::~FakeServer() { server_->Shutdown(std::chrono::system_clock::now()); }

void FakeServer::SetServing(bool serving) {
  server_->GetHealthCheckService()->SetServingStatus(serving);
}

grpc::Status FakeServer::FailureOf(const std::string& method) {
  const auto found = failures.find(method);
  return found == failures.end() ? grpc::Status::OK : found->second;
}

}  // namespace rigcal::testing
