// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "server/session/agent_directory.h"
#include "server/session/session_coordinator.h"
#include "tests/server/session/faulty_store.h"
#include "tests/server/session/recording_link.h"
#include "tests/server/store/store_fixture.h"

namespace rigcal::testing {

// A camera of 1280x1024 pixels with intrinsics.
CameraDescription MakeCamera(const std::string& name);
// An agent of rig "rig" with these cameras, each in stream epoch 1.
AgentRecord MakeAgent(const std::string& agent_id, const std::vector<std::string>& cameras,
                      uint32_t incarnation = 1, uint32_t connection = 1);
// A session to be created, of rig "rig" with a wand of three markers.
Session NewSession(const std::string& id);

// A coordinator over a real store, with faults on demand.
class SessionFixture : public StoreFixture {
 protected:
  void SetUp() override;
  void TearDown() override;
  // Ends the coordinator and the store without a shutdown and starts them again, as after kill -9.
  void Restart();

  struct ConnectedAgent {
    std::shared_ptr<RecordingLink> link;
    server::AgentDirectory::Registration registration = 0;
    std::vector<StreamPosition> positions;
  };
  ConnectedAgent Connect(AgentRecord agent, const std::vector<StreamKey>& pending = {});
  // Rows of a stream through the store, and the progress to the coordinator, as ingest does.
  server::AppendOutcome Deliver(const StreamKey& stream, uint32_t first_seq, uint32_t last_seq);
  server::AppendOutcome DeliverEnd(const StreamKey& stream, uint32_t last_seq);
  // A session of these cameras, without agents, that has been started.
  void StartByHand(const std::string& id, const std::vector<std::string>& cameras);
  // The same, each camera with `rows` rows, finished.
  void FinishByHand(const std::string& id, const std::vector<std::string>& cameras,
                    uint32_t rows = 20);
  struct SessionView {
    Session session;
    std::vector<SessionCameraCounts> counts;
    std::vector<std::string> connected_cameras;
  };
  absl::StatusOr<SessionView> View(const std::string& id) const;
  // Watches until the session is finished; fails the test when it takes unreasonably long.
  Session AwaitFinished(const std::string& id);
  server::SessionCoordinator& coordinator() { return *coordinator_; }
  FaultyStore& faulty() { return *faulty_; }

  server::SessionCoordinatorOptions options_;
  server::AgentDirectoryOptions directory_options_;
  std::unique_ptr<FaultyStore> faulty_;
  std::unique_ptr<server::AgentDirectory> directory_of_agents_;
  std::unique_ptr<server::SessionCoordinator> coordinator_;

 private:
  void OpenCoordinator();
  server::AppendOutcome DeliverOne(const server::Delivery& delivery);
};

}  // namespace rigcal::testing
