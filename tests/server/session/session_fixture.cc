// SPDX-License-Identifier: Apache-2.0
#include "tests/server/session/session_fixture.h"

#include <utility>

#include "common/status/status_macros.h"
#include "tests/server/session/change_waiter.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing {

CameraDescription MakeCamera(const std::string& name) {
  CameraDescription camera;
  camera.camera = name;
  camera.image_size_px = {.width = 1280, .height = 1024};
  camera.intrinsics = Intrinsics{.model = DistortionModel::kBrownConrady,
                                 .fx_px = 1000,
                                 .fy_px = 1000,
                                 .cx_px = 640,
                                 .cy_px = 512,
                                 .distortion = {}};
  camera.clock = {.clock_id = name, .timebase = "recording"};
  return camera;
}

AgentRecord MakeAgent(const std::string& agent_id, const std::vector<std::string>& cameras,
                      uint32_t incarnation, uint32_t connection) {
  AgentRecord agent;
  agent.agent_id = agent_id;
  agent.incarnation = incarnation;
  agent.connection = connection;
  agent.host = "host-of-" + agent_id;
  agent.rig = "rig";
  for (const std::string& camera : cameras) agent.cameras.push_back({MakeCamera(camera), 1});
  return agent;
}

Session NewSession(const std::string& id) {
  Session session;
  session.id = id;
  session.rig = "rig";
  session.target.marker_positions_m = {0, 0.13, 0.39};
  return session;
}

void SessionFixture::SetUp() {
  StoreFixture::SetUp();
  OpenCoordinator();
}

void SessionFixture::OpenCoordinator() {
  faulty_ = std::make_unique<FaultyStore>(store_.get());
  directory_of_agents_ = std::make_unique<server::AgentDirectory>(directory_options_);
  ASSERT_OK_AND_ASSIGN(coordinator_, server::SessionCoordinator::Create(
                                         options_, faulty_.get(), directory_of_agents_.get()));
  coordinator_->Start();
}

void SessionFixture::TearDown() { coordinator_.reset(); }

void SessionFixture::Restart() {
  coordinator_.reset();
  directory_of_agents_.reset();
  faulty_.reset();
  Reopen();
  OpenCoordinator();
}

SessionFixture::ConnectedAgent SessionFixture::Connect(AgentRecord agent,
                                                       const std::vector<StreamKey>& pending) {
  ConnectedAgent connected;
  connected.link = std::make_shared<RecordingLink>();
  auto connection = coordinator_->ConnectAgent(std::move(agent), pending, connected.link);
  EXPECT_THAT(connection, IsOk());
  if (!connection.ok()) return connected;
  connected.registration = connection->registration;
  connected.positions = std::move(connection->positions);
  return connected;
}

server::AppendOutcome SessionFixture::DeliverOne(const server::Delivery& delivery) {
  const server::AppendOutcome outcome = Append(delivery);
  coordinator_->RecordProgress(delivery.stream(), outcome);
  return outcome;
}

server::AppendOutcome SessionFixture::Deliver(const StreamKey& stream, uint32_t first_seq,
                                              uint32_t last_seq) {
  return DeliverOne(MakeDelivery(MakeBatch(stream, first_seq, last_seq)));
}

server::AppendOutcome SessionFixture::DeliverEnd(const StreamKey& stream, uint32_t last_seq) {
  return DeliverOne(EndDelivery(stream, last_seq));
}

void SessionFixture::StartByHand(const std::string& id, const std::vector<std::string>& cameras) {
  Session session = NewSession(id);
  for (const std::string& camera : cameras) session.cameras.push_back({MakeCamera(camera), ""});
  ASSERT_THAT(coordinator_->CreateSession(session), IsOk());
  ASSERT_THAT(coordinator_->StartSession(id), IsOk());
}

void SessionFixture::FinishByHand(const std::string& id, const std::vector<std::string>& cameras,
                                  uint32_t rows) {
  StartByHand(id, cameras);
  for (const std::string& camera : cameras) {
    Deliver({id, camera, 1}, 1, rows);
    DeliverEnd({id, camera, 1}, rows);
  }
  AwaitFinished(id);
}

absl::StatusOr<SessionFixture::SessionView> SessionFixture::View(const std::string& id) const {
  SessionView view;
  RIGCAL_ASSIGN_OR_RETURN(view.session, store_->GetSession(id));
  RIGCAL_ASSIGN_OR_RETURN(view.counts, store_->GetSessionCounts(id));
  view.connected_cameras = directory_of_agents_->ConnectedCameraNames(view.session.rig);
  return view;
}

Session SessionFixture::AwaitFinished(const std::string& id) {
  ChangeWaiter changes;
  const auto watch = coordinator_->WatchSession(id, changes.Wake());
  EXPECT_THAT(watch, IsOk());
  const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (watch.ok() && std::chrono::steady_clock::now() < limit) {
    const auto session = store_->GetSession(id);
    EXPECT_THAT(session, IsOk());
    if (!session.ok() || session->state == SessionState::kFinished) return *session;
    changes.Wait(std::chrono::milliseconds(1000));
  }
  ADD_FAILURE() << "session " << id << " does not finish";
  return {};
}

}  // namespace rigcal::testing
