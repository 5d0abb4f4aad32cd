// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "agent/capture/preview/preview_tap.h"
#include "common/session/preview.h"

namespace rigcal::agent {

struct PreviewOptions {
  bool enabled = false;    // pictures leave the PC only where somebody allowed it
  double max_rate_hz = 1;  // per camera, above 0 to 10
  size_t max_jpeg_bytes = size_t{256} << 10;  // 8 KiB to 1 MiB; the server may ask for less

  // INVALID_ARGUMENT with every fault.
  absl::Status Validate() const;
};

// What a camera is doing, as far as it concerns its previews.
struct PreviewSubject {
  bool known = false;         // the agent has it
  bool capturing = false;     // only then it takes pictures
  PreviewTap* tap = nullptr;  // null: no pictures; must live until Shutdown
};

// Makes pictures for people from what cameras see, on a thread of its own, so that the capture is
// held up by the copy of one picture and by nothing else. At most one request per camera at a time,
// and no more of them than the options allow. Any thread may call.
class PreviewWorker {
 public:
  // `on_answer` is called on any thread when there is a new answer; it must neither block nor call
  // back.
  PreviewWorker(PreviewOptions options, std::function<void()> on_answer);
  ~PreviewWorker();
  PreviewWorker(const PreviewWorker&) = delete;
  PreviewWorker& operator=(const PreviewWorker&) = delete;

  // Each request gets one answer, a refusal at once, a picture or kTimedOut within
  // request.max_wait_ms and the time to draw it.
  void Request(const PreviewRequest& request, const PreviewSubject& subject);
  // None: there is none now.
  std::optional<Preview> TakeAnswer();
  // Forgets requests and answers: whoever asked has gone.
  void Forget();
  // No tap is used, and no answer made, after the return.
  void Shutdown();

 private:
  using Clock = std::chrono::steady_clock;
  struct Waiting {
    PreviewRequest request;
    PreviewTap* tap = nullptr;
    Clock::time_point deadline;
    std::optional<PreviewFrame> frame;  // has come, and is to be drawn
  };

  std::optional<Preview> Refused(const PreviewRequest& request, const PreviewSubject& subject);
  void TakeFrame(const std::string& camera, uint32_t request_id, PreviewFrame frame);
  void Run();
  // Makes the answer of a request whose picture has come or whose time is over; unlocks meanwhile.
  void Finish(std::unique_lock<std::mutex>& lock, Waiting* due);
  Preview Draw(const PreviewRequest& request, const PreviewFrame& frame) const;
  void Answer(Preview preview);

  const PreviewOptions options_;
  const std::function<void()> on_answer_;

  // A tap's lock is held while TakeFrame takes this one: no tap is called with it held.
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::string, Waiting> waiting_;               // by camera
  std::map<std::string, Clock::time_point> last_asked_;  // by camera; requests that were granted
  std::deque<Preview> answers_;
  bool shut_down_ = false;
  std::thread thread_;
};

}  // namespace rigcal::agent
