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

#include "agent/capture/preview/preview_tap.h"
#include "common/session/preview.h"

namespace rigcal::agent {

struct PreviewOptions {
  bool enabled = false;                       // frames leave the PC only where somebody allowed it
  double max_rate_hz = 1;                     // per camera, above 0 to 10
  size_t max_jpeg_bytes = size_t{256} << 10;  // 8 KiB to 1 MiB; the server may ask for less
};

// State of a camera that matters for previews.
struct PreviewSubject {
  bool known = false;         // the agent has it
  bool capturing = false;     // frames arrive only then
  PreviewTap* tap = nullptr;  // null: no frames; must live until Shutdown
};

// Makes previews on a thread of its own, so that a capture is delayed by the copy of one frame
// only. At most one request per camera at a time, at most at the rate of the options. Any thread
// may call.
class PreviewWorker {
 public:
  // `on_answer` is called on any thread for each new answer; it must neither block nor call back.
  PreviewWorker(PreviewOptions options, std::function<void()> on_answer);
  ~PreviewWorker() { Shutdown(); }
  PreviewWorker(const PreviewWorker&) = delete;
  PreviewWorker& operator=(const PreviewWorker&) = delete;

  // Each request gets one answer: a refusal at once, or a preview or kTimedOut within
  // request.max_wait_ms plus the time to draw it.
  void Request(const PreviewRequest& request, const PreviewSubject& subject);
  // None: no answer is ready.
  std::optional<Preview> TakeAnswer();
  // Drops requests and answers, because the client has gone.
  void Forget();
  // After the return no tap is used and no answer is made.
  void Shutdown();

 private:
  using Clock = std::chrono::steady_clock;
  struct Waiting {
    PreviewRequest request;
    PreviewTap* tap = nullptr;
    Clock::time_point deadline;
    std::optional<PreviewFrame> frame;  // to be drawn
  };

  std::optional<Preview> Refused(const PreviewRequest& request, const PreviewSubject& subject);
  void TakeFrame(const std::string& camera, uint32_t request_id, PreviewFrame frame);
  void Run();
  // Answers a request whose frame has arrived or that has timed out; unlocks meanwhile.
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
