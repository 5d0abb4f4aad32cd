// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/watch_hub.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>

#include "absl/strings/str_cat.h"

namespace rigcal::server {
namespace {

constexpr std::chrono::milliseconds kShortestInterval{200};  // between messages of a stream

absl::Status Ending() {
  return absl::UnavailableError("the server is shutting down; watch again after a moment");
}

}  // namespace

WatchHub::WatchHub() : thread_([this] { Run(); }) {}

WatchHub::~WatchHub() {
  Update([this] { stopping_ = true; });
  thread_.join();
}

void WatchHub::Update(absl::FunctionRef<void()> change) {
  {
    std::lock_guard lock(mutex_);
    change();
  }
  wake_.notify_all();
}

absl::Status WatchHub::Add(const std::shared_ptr<WatchStream>& stream) {
  bool refused = false;
  Update([&] {
    refused = ending_;
    if (!refused) streams_.insert(stream);
  });
  return refused ? Ending() : absl::OkStatus();
}

void WatchHub::Remove(const std::shared_ptr<WatchStream>& stream) {
  std::unique_ptr<ChangeNotifier::Watch> watch;  // released without the lock: it takes another one
  std::lock_guard lock(mutex_);
  watch = std::move(stream->watch_);
  streams_.erase(stream);
}

void WatchHub::Wake(WatchStream* stream) {
  Update([stream] { stream->changed_ = true; });
}

void WatchHub::Cancel(WatchStream* stream) {
  Update([stream] { stream->cancelled_ = true; });
}

void WatchHub::WriteDone(WatchStream* stream, bool ok) {
  Update([stream, ok] {
    stream->busy_ = false;
    if (!ok) stream->cancelled_ = true;
  });
}

void WatchHub::EndStreams() {
  Update([this] { ending_ = true; });
}

std::shared_ptr<WatchStream> WatchHub::NextStream(
    std::chrono::steady_clock::time_point* wake_at) const {
  const auto now = std::chrono::steady_clock::now();
  *wake_at = std::chrono::steady_clock::time_point::max();
  for (const std::shared_ptr<WatchStream>& stream : streams_) {
    if (stream->finished_ || stream->busy_) continue;
    if (ending_ || stream->cancelled_) return stream;
    if (!stream->changed_) continue;
    if (stream->not_before_ <= now) return stream;
    *wake_at = std::min(*wake_at, stream->not_before_);
  }
  return nullptr;
}

void WatchHub::Run() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    std::chrono::steady_clock::time_point wake_at;
    const std::shared_ptr<WatchStream> stream = NextStream(&wake_at);
    if (!stream) {
      if (wake_at == std::chrono::steady_clock::time_point::max()) {
        wake_.wait(lock);
      } else {
        wake_.wait_until(lock, wake_at);
      }
      continue;
    }
    stream->finished_ = ending_ || stream->cancelled_;
    const absl::Status end = stream->cancelled_
                                 ? absl::CancelledError("the client has disconnected")
                                 : (ending_ ? Ending() : absl::OkStatus());
    stream->busy_ = true;
    stream->changed_ = false;
    stream->not_before_ = std::chrono::steady_clock::now() + kShortestInterval;
    lock.unlock();
    if (end.ok()) {
      Serve(*stream);
    } else {
      stream->Finish(end);
    }
    lock.lock();
  }
}

void WatchHub::Serve(WatchStream& stream) {
  absl::StatusOr<bool> last = false;
  try {
    last = stream.Read();
  } catch (const std::exception& error) {
    spdlog::error("watch: an unexpected fault: {}", error.what());
    last = absl::InternalError(absl::StrCat("an unexpected fault: ", error.what()));
  }
  if (last.ok() && !*last) return stream.Write();
  {
    std::lock_guard lock(mutex_);
    stream.finished_ = true;
  }
  if (last.ok()) return stream.WriteAndFinish();
  stream.Finish(last.status());
}

}  // namespace rigcal::server
