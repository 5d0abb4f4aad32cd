// SPDX-License-Identifier: Apache-2.0
#include "tests/server/rpc/rpc_fixture.h"

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>

#include <chrono>

#include "common/wire/camera_wire.h"
#include "common/wire/grpc_status.h"

namespace rigcal::testing {

void RpcFixture::SetUp() {
  RunnerFixture::SetUp();
  OpenServer();
}

void RpcFixture::OpenServer() {
  live_ = std::make_unique<server::LiveTracker>(server::LiveTrackerOptions{}, faulty_.get(),
                                                directory_of_agents_.get(), coordinator_.get());
  ingest_ = std::make_unique<server::Ingest>(
      ingest_options_, faulty_.get(),
      [this](const StreamKey& stream) { return coordinator_->contexts().GetStreamContext(stream); },
      [this](const StreamKey& stream, const server::AppendOutcome& outcome) {
        coordinator_->RecordProgress(stream, outcome);
      },
      [this](const server::Delivery& delivery, const server::AppendOutcome& outcome) {
        live_->RecordDelivery(delivery, outcome);
      });
  ingest_->Start();
  standbys_ = std::make_unique<server::StandbyBook>(&faulty_->changes());
  rpc_ = std::make_unique<server::RpcServer>(
      rpc_options_, server::RpcServerParts{.store = faulty_.get(),
                                           .ingest = ingest_.get(),
                                           .directory = directory_of_agents_.get(),
                                           .coordinator = coordinator_.get(),
                                           .runner = runner_.get(),
                                           .registry = registry_.get(),
                                           .audit = audit_.get(),
                                           .identities = identities_.get(),
                                           .live = live_.get(),
                                           .standbys = standbys_.get()});
  ASSERT_OK_AND_ASSIGN(port_, rpc_->Start());
  channel_ = rpc_->InProcessChannel();
}

void RpcFixture::CloseServer() {
  channel_.reset();
  rpc_.reset();
  standbys_.reset();
  ingest_.reset();
  live_.reset();
}

void RpcFixture::TearDown() {
  CloseServer();
  RunnerFixture::TearDown();
}

void RpcFixture::RestartServer() {
  CloseServer();
  RestartAll();
  OpenServer();
}

void RpcFixture::RestartServerOnPort() {
  rpc_options_.endpoint.listen_address = "127.0.0.1:0";
  RestartServer();
  channel_ =
      grpc::CreateChannel("127.0.0.1:" + std::to_string(port_), grpc::InsecureChannelCredentials());
}

v1::CreateSessionRequest RpcFixture::WaveRequest(const std::string& id) const {
  v1::CreateSessionRequest request;
  request.set_id(id);
  *request.mutable_target() = wire::ToProto(NewSession("").target);
  return request;
}

void RpcFixture::StartWave(const std::vector<std::string>& cameras) {
  v1::CreateSessionRequest request = WaveRequest("wave");
  for (const std::string& camera : cameras) {
    *request.add_cameras() = wire::ToProto(MakeCamera(camera));
  }
  ASSERT_THAT(client().CreateSession(request), IsOk());
  ASSERT_THAT(client().StartSession("wave"), IsOk());
}

v1::Session RpcFixture::AwaitState(const std::string& id, v1::Session::State state) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
  v1::WatchSessionRequest request;
  request.set_id(id);
  const auto reader = v1::SessionService::NewStub(channel_)->WatchSession(&context, request);
  v1::WatchSessionResponse response;
  while (reader->Read(&response)) {
    if (response.session().state() == state) {
      context.TryCancel();
      reader->Finish();
      return response.session();
    }
  }
  ADD_FAILURE() << "session " << id << ": " << reader->Finish().error_message();
  return response.session();
}

}  // namespace rigcal::testing
