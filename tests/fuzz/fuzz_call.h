// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace rigcal::testing {

// One call of any kind, with bytes as messages. Every wait ends with the call's deadline.
class FuzzCall final : public grpc::ClientBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
 public:
  // After `max_answers` the call is cancelled: a watch has no end of its own.
  FuzzCall(grpc::GenericStub* stub, const std::string& method, size_t max_answers)
      : max_answers_(max_answers) {
    context_.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(20));
    stub->PrepareBidiStreamingCall(&context_, method, {}, this);
    AddHold();
    StartRead(&answer_);
    StartCall();
  }

  void Send(const std::string& bytes) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return !writing_ || ended_; });
    if (ended_ || broken_) return;
    writing_ = true;
    const grpc::Slice slice(bytes);
    message_ = grpc::ByteBuffer(&slice, 1);
    StartWrite(&message_);
    changed_.wait(lock, [this] { return !writing_; });
  }
  // Ends the client's side and waits for the server's.
  grpc::Status Finish() {
    if (!std::exchange(finishing_, true)) {
      StartWritesDone();
      RemoveHold();
    }
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return ended_; });
    return status_;
  }
  // Only after Finish.
  const std::vector<std::string>& answers() const { return answers_; }
  bool cancelled() const { return cancelled_; }

  void OnReadDone(bool ok) override {
    if (!ok) return;
    std::vector<grpc::Slice> slices;
    answer_.Dump(&slices);
    std::string bytes;
    for (const grpc::Slice& slice : slices) {
      bytes.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
    }
    answers_.push_back(std::move(bytes));
    if (answers_.size() >= max_answers_) {
      cancelled_ = true;
      context_.TryCancel();
    }
    StartRead(&answer_);
  }
  void OnWriteDone(bool ok) override {
    std::lock_guard lock(mutex_);
    writing_ = false;
    broken_ |= !ok;
    changed_.notify_all();
  }
  void OnDone(const grpc::Status& status) override {
    std::lock_guard lock(mutex_);
    ended_ = true;
    status_ = status;
    changed_.notify_all();
  }

 private:
  const size_t max_answers_;
  grpc::ClientContext context_;
  grpc::ByteBuffer message_;
  grpc::ByteBuffer answer_;
  std::vector<std::string> answers_;
  bool cancelled_ = false;
  bool finishing_ = false;

  std::mutex mutex_;
  std::condition_variable changed_;
  bool writing_ = false;
  bool broken_ = false;
  bool ended_ = false;
  grpc::Status status_;
};

}  // namespace rigcal::testing
