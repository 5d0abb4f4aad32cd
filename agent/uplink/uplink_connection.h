// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/grpcpp.h>

#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "rigcal/v1/ingest_service.grpc.pb.h"

namespace rigcal::agent {

// One Connect stream to the server: writes one message at a time, keeps received messages until
// they are taken, and reports the end of the stream. `on_event` is called on gRPC's threads
// whenever one of these changes; it must neither block nor call back.
// The server gets the correlation id of the thread that makes it.
//
// Write, TakeMessages and the getters are for one thread.
class UplinkConnection : private grpc::ClientBidiReactor<v1::ConnectRequest, v1::ConnectResponse> {
 public:
  UplinkConnection(std::shared_ptr<grpc::Channel> channel, std::function<void()> on_event);
  // Cancels the stream where it still runs, and waits for its end.
  ~UplinkConnection() override;
  UplinkConnection(const UplinkConnection&) = delete;
  UplinkConnection& operator=(const UplinkConnection&) = delete;

  // The message before has left, and the stream is open.
  bool CanWrite() const;
  // Only while CanWrite() is true.
  void Write(v1::ConnectRequest message);
  // Received messages, in order. Reading continues only when they are taken.
  std::vector<v1::ConnectResponse> TakeMessages();
  // Once the stream has ended and every received message is taken.
  std::optional<absl::Status> Result() const;
  // Of a stream that has ended: the server to ask instead, as a waiting server names it.
  std::string ActiveServer() const;

  // Tells the server that nothing more will be written.
  void FinishWriting();
  void Cancel() { context_.TryCancel(); }

 private:
  void OnReadDone(bool ok) override;
  void OnWriteDone(bool ok) override;
  void OnDone(const grpc::Status& status) override;
  void ResumeReadingLocked();

  const std::function<void()> on_event_;
  grpc::ClientContext context_;
  std::unique_ptr<v1::IngestService::Stub> stub_;

  mutable std::mutex mutex_;
  std::condition_variable done_changed_;
  v1::ConnectRequest outgoing_;
  v1::ConnectResponse incoming_;
  std::deque<v1::ConnectResponse> inbox_;
  bool writing_ = false;
  bool reading_ = false;
  bool broken_ = false;  // no more reads, and no more writes are of use
  bool finished_writing_ = false;
  std::optional<absl::Status> result_;
};

}  // namespace rigcal::agent
