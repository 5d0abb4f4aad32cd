// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/support/server_callback.h>

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <thread>
#include <utility>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/wire/grpc_status.h"
#include "server/session/change_notifier.h"

namespace rigcal::server {

// A watching stream as the hub sees it.
class WatchStream {
 public:
  virtual ~WatchStream() = default;

 private:
  friend class WatchHub;

  // Fills the next message. True: it is the last one. An error ends the stream.
  virtual absl::StatusOr<bool> Read() = 0;
  virtual void Write() = 0;
  virtual void WriteAndFinish() = 0;
  virtual void Finish(const absl::Status& status) = 0;

  // Under the hub's mutex.
  bool changed_ = true;  // the first state is sent at once
  bool busy_ = false;    // being read, or written to the client
  bool cancelled_ = false;
  bool finished_ = false;
  std::chrono::steady_clock::time_point not_before_{};
  std::unique_ptr<ChangeNotifier::Watch> watch_;
};

// Serves all watching streams from one thread, however many there are: the thread reads the state
// of a resource that has changed and starts the write; gRPC completes it. A stream has one message
// in memory. Changes that come while it is being written count as one, so that a slow reader gets
// the latest state and nothing piles up. Thread-safe.
class WatchHub {
 public:
  WatchHub();
  // All streams must have ended: after the gRPC server's shutdown.
  ~WatchHub();

  // Opens a stream of `Message`s. `add` registers its wake function with a notifier; `read` runs on
  // the hub's thread, fills the message and returns true with the last one. Does not block.
  template <typename Message>
  grpc::ServerWriteReactor<Message>* Open(
      const std::function<
          absl::StatusOr<std::unique_ptr<ChangeNotifier::Watch>>(std::function<void()> wake)>& add,
      std::function<absl::StatusOr<bool>(Message*)> read);

  // Ends every stream with UNAVAILABLE; no new ones begin. Does not wait for them.
  void EndStreams();

 private:
  template <typename Message>
  class Reactor;

  // Makes a change under the mutex, and wakes the thread.
  void Update(absl::FunctionRef<void()> change);
  absl::Status Add(const std::shared_ptr<WatchStream>& stream);
  void Remove(const std::shared_ptr<WatchStream>& stream);
  void Wake(WatchStream* stream);
  void Cancel(WatchStream* stream);
  void WriteDone(WatchStream* stream, bool ok);

  void Run();
  // With mutex_ held: a stream with something to do now, and else when there will be one.
  std::shared_ptr<WatchStream> NextStream(std::chrono::steady_clock::time_point* wake_at) const;
  void Serve(WatchStream& stream);

  std::mutex mutex_;
  std::condition_variable wake_;
  std::set<std::shared_ptr<WatchStream>> streams_;
  bool ending_ = false;
  bool stopping_ = false;
  std::thread thread_;
};

// Lives until OnDone.
template <typename Message>
class WatchHub::Reactor final : public grpc::ServerWriteReactor<Message>,
                                public WatchStream,
                                public std::enable_shared_from_this<Reactor<Message>> {
 public:
  Reactor(WatchHub* hub, std::function<absl::StatusOr<bool>(Message*)> read)
      : hub_(*hub), read_(std::move(read)) {}

  void OnWriteDone(bool ok) override { hub_.WriteDone(this, ok); }
  void OnCancel() override { hub_.Cancel(this); }
  void OnDone() override {
    const std::shared_ptr<Reactor> self = std::move(self_);
    hub_.Remove(self);
  }

  void HoldUntilDone() { self_ = this->shared_from_this(); }

 private:
  absl::StatusOr<bool> Read() override {
    message_.Clear();
    return read_(&message_);
  }
  void Write() override { this->StartWrite(&message_); }
  void WriteAndFinish() override {
    this->StartWriteAndFinish(&message_, grpc::WriteOptions(), grpc::Status::OK);
  }
  void Finish(const absl::Status& status) override {
    grpc::ServerWriteReactor<Message>::Finish(wire::ToGrpc(status));
  }

  WatchHub& hub_;
  const std::function<absl::StatusOr<bool>(Message*)> read_;
  Message message_;
  std::shared_ptr<Reactor> self_;
};

// A stream that is refused when it opens.
template <typename Message>
class RefusedWatch final : public grpc::ServerWriteReactor<Message> {
 public:
  explicit RefusedWatch(const absl::Status& reason) { this->Finish(wire::ToGrpc(reason)); }
  void OnDone() override { delete this; }
};

template <typename Message>
grpc::ServerWriteReactor<Message>* WatchHub::Open(
    const std::function<
        absl::StatusOr<std::unique_ptr<ChangeNotifier::Watch>>(std::function<void()> wake)>& add,
    std::function<absl::StatusOr<bool>(Message*)> read) {
  const auto reactor = std::make_shared<Reactor<Message>>(this, std::move(read));
  WatchStream* const stream = reactor.get();
  auto watch = add([this, stream] { Wake(stream); });
  if (!watch.ok()) return new RefusedWatch<Message>(watch.status());
  stream->watch_ = *std::move(watch);
  if (absl::Status status = Add(reactor); !status.ok()) return new RefusedWatch<Message>(status);
  reactor->HoldUntilDone();
  return reactor.get();
}

}  // namespace rigcal::server
