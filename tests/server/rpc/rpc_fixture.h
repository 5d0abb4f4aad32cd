// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/channel.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "rigcal/v1/calibration_service.grpc.pb.h"
#include "rigcal/v1/session_service.grpc.pb.h"
#include "rigcal/v1/status_service.grpc.pb.h"
#include "server/ingest/ingest.h"
#include "server/live/live_tracker.h"
#include "server/replica/standby_book.h"
#include "server/rpc/rpc_server.h"
#include "tests/server/rpc/test_agent.h"
#include "tests/server/session/runner_fixture.h"
#include "tests/testing/server_client.h"

namespace rigcal::testing {

// The whole server but the solver, over a real store, reached through a channel in the process.
class RpcFixture : public RunnerFixture {
 protected:
  RpcFixture() { rpc_options_.endpoint.listen_address.clear(); }
  void SetUp() override;
  void TearDown() override;
  // Ends the server and starts it anew on the same store.
  void RestartServer();
  // The same, reached over TCP: a channel in the process breaks at once when the server ends.
  void RestartServerOnPort();
  void OpenServer();
  void CloseServer();

  std::shared_ptr<grpc::Channel> channel() const { return channel_; }
  ServerClient client() const { return ServerClient(channel_); }
  // A session "wave" of these cameras, capturing.
  void StartWave(const std::vector<std::string>& cameras = {});
  v1::CreateSessionRequest WaveRequest(const std::string& id) const;
  v1::Session AwaitState(const std::string& id, v1::Session::State state);

  server::RpcServerOptions rpc_options_;
  server::IngestOptions ingest_options_;
  // All null unless a test sets them before the server opens.
  std::unique_ptr<server::IdentityAuthority> identities_;
  std::unique_ptr<server::AgentRegistry> registry_;
  std::unique_ptr<server::AuditLog> audit_;
  // Makes the live state when a test calls Update; its own thread does not run.
  std::unique_ptr<server::LiveTracker> live_;
  std::unique_ptr<server::Ingest> ingest_;
  std::unique_ptr<server::StandbyBook> standbys_;
  std::unique_ptr<server::RpcServer> rpc_;
  int port_ = 0;
  std::shared_ptr<grpc::Channel> channel_;
};

}  // namespace rigcal::testing
