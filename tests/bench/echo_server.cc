// SPDX-License-Identifier: Apache-2.0
// The reference of the ingest suite: acknowledges every message of the same stream at once, storing
// and checking nothing. Prints its port; ends with its standard input.
#include <grpcpp/grpcpp.h>

#include <iostream>
#include <memory>
#include <string>

#include "rigcal/v1/ingest_service.grpc.pb.h"

namespace rigcal::bench {
namespace {

class EchoReactor : public grpc::ServerBidiReactor<v1::ConnectRequest, v1::ConnectResponse> {
 public:
  EchoReactor() { StartRead(&message_); }

  void OnReadDone(bool ok) override {
    if (!ok) return Finish(grpc::Status::OK);
    if (message_.has_hello()) {
      answer_.mutable_hello()->set_server_id("echo");
    } else {
      const v1::ObservationBatch& batch = message_.batch();
      v1::BatchAck* ack = answer_.mutable_ack();
      ack->set_camera(batch.camera());
      ack->set_durable_seq(batch.first_seq() + static_cast<uint32_t>(batch.time_ns_size()) - 1);
    }
    StartWrite(&answer_);
  }
  void OnWriteDone(bool ok) override {
    if (!ok) return Finish(grpc::Status::OK);
    StartRead(&message_);
  }
  void OnDone() override { delete this; }

 private:
  v1::ConnectRequest message_;
  v1::ConnectResponse answer_;
};

class EchoService : public v1::IngestService::CallbackService {
 public:
  grpc::ServerBidiReactor<v1::ConnectRequest, v1::ConnectResponse>* Connect(
      grpc::CallbackServerContext*) override {
    return new EchoReactor;
  }
};

}  // namespace
}  // namespace rigcal::bench

int main() {
  rigcal::bench::EchoService service;
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
  builder.RegisterService(&service);
  const std::unique_ptr<grpc::Server> server = builder.BuildAndStart();
  if (!server) return 1;
  std::cout << port << std::endl;
  std::cin.get();
  server->Shutdown();
  return 0;
}
