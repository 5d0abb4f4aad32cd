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

// Wakes a thread that waits for a frame or another change. Rung by any thread.
class CaptureBell {
 public:
  void Ring() {
    const std::lock_guard lock(mutex_);
    rung_ = true;
    changed_.notify_all();
  }
  // Returns at once if it was rung since the last wait. False: timed out.
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

// A running stream of frames: its buffers and the thread that fills them. For one thread; the bell
// rings for each frame. Ends without the camera, which may be gone.
class AravisStream {
 public:
  // Allocates the buffers and starts the camera. Both arguments must outlive the stream.
  static absl::StatusOr<std::unique_ptr<AravisStream>> Start(AravisCamera* camera,
                                                             const AravisSourceOptions& options,
                                                             CaptureBell* bell);
  AravisStream(const AravisStream&) = delete;
  AravisStream& operator=(const AravisStream&) = delete;

  // The next frame that has arrived, complete or not; null if there is none. Give it back.
  ArvBuffer* TryPop() { return arv_stream_try_pop_buffer(stream_.get()); }
  void GiveBack(ArvBuffer* buffer);

  // Stops the camera. Frames in transit still arrive: TryPop until WaitForLast is false.
  void StopCamera();
  // Waits for the next frame; false: there are no more.
  bool WaitForLast();

  // Frames that arrived while every buffer was in use, estimated from their packets.
  uint64_t underruns() const { return packets_without_buffer() / packets_per_frame_; }

 private:
  AravisStream(AravisCamera* camera, CaptureBell* bell) : camera_(camera), bell_(bell) {}
  uint64_t packets_without_buffer() const;
  static void OnEvent(void* self, ArvStreamCallbackType type, ArvBuffer* buffer);

  AravisCamera* const camera_;
  CaptureBell* const bell_;
  std::atomic<uint64_t> begun_ = 0;  // frames
  std::atomic<uint64_t> done_ = 0;
  uint64_t packets_per_frame_ = 1;
  std::chrono::steady_clock::time_point last_wait_ends_;
  GObjectPtr<ArvStream> stream_;
};

}  // namespace rigcal::agent
