// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>

#include "absl/status/statusor.h"
#include "agent/capture/genicam/aravis_camera.h"
#include "agent/capture/genicam/aravis_objects.h"

namespace rigcal::agent {

// Tells a waiting thread that a picture came, or that something else needs its attention. Rung by
// any thread.
class CaptureBell {
 public:
  void Ring() {
    {
      const std::lock_guard lock(mutex_);
      rung_ = true;
    }
    changed_.notify_all();
  }
  // Returns at once if it was rung since the last wait. False: `limit` has gone by.
  bool Wait(std::chrono::milliseconds limit) {
    std::unique_lock lock(mutex_);
    const bool rung = changed_.wait_for(lock, limit, [&] { return rung_; });
    rung_ = false;
    return rung;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool rung_ = false;
};

// The pictures of one camera while it sends: its buffers and the thread that fills them. For one
// thread; the bell rings for each picture.
class AravisStream {
 public:
  // Makes the buffers and lets the camera send. Both arguments must outlive the stream.
  static absl::StatusOr<std::unique_ptr<AravisStream>> Start(AravisCamera* camera,
                                                             const AravisSourceOptions& options,
                                                             CaptureBell* bell);
  // Ends without asking the camera, for one that is gone or after Finish.
  ~AravisStream();
  AravisStream(const AravisStream&) = delete;
  AravisStream& operator=(const AravisStream&) = delete;

  // The next picture that has come, whole or not; none if there is none yet. Give it back.
  ArvBuffer* TryPop() { return arv_stream_try_pop_buffer(stream_.get()); }
  void GiveBack(ArvBuffer* buffer);

  // Tells the camera to send no more. What is on its way comes yet: TryPop until WaitForLast says
  // that nothing more can come.
  void StopCamera();
  // Waits for the next picture; false: that was all.
  bool WaitForLast();

  // Pictures that came while every buffer was in use, as far as their packets tell.
  uint64_t underruns() const;

 private:
  AravisStream(AravisCamera* camera, CaptureBell* bell) : camera_(camera), bell_(bell) {}
  static void OnEvent(void* self, ArvStreamCallbackType type, ArvBuffer* buffer);

  AravisCamera* const camera_;
  CaptureBell* const bell_;
  std::atomic<uint64_t> begun_ = 0;  // pictures
  std::atomic<uint64_t> done_ = 0;
  uint64_t packets_per_picture_ = 1;
  std::chrono::steady_clock::time_point last_wait_ends_;
  GObjectPtr<ArvStream> stream_;
};

}  // namespace rigcal::agent
