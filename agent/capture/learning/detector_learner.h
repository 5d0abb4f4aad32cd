// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "agent/capture/detector_control.h"
#include "agent/capture/learning/learning_task.h"
#include "common/session/detector.h"

namespace rigcal::agent {

struct LearningOptions {
  std::filesystem::path folder;  // where what was learnt is kept; empty: nowhere
  uint32_t mask_frames = 100;
  uint32_t colour_frames = 50;
  uint32_t max_frames = 1000;
  // The frames are spread over so long at least, however few they are, so that a moving wand is at
  // different places in them and the capture is not held up.
  std::chrono::milliseconds mask_span{3'000};
  std::chrono::milliseconds colour_span{5'000};
  // For all frames; a learning that takes longer fails.
  std::chrono::milliseconds time_limit{60'000};
};

// Answers what the server asks of the detectors of an agent, and learns masks and colours on a
// thread of its own with low priority: a capture is delayed by the copy of a frame only. One
// learning at a time per camera. What is learnt is in use from the next frame on, and is kept in
// files. Any thread may call.
class DetectorLearner {
 public:
  // By the camera's name; null: it has no detector of frames.
  using Detectors = std::map<std::string, DetectorControl*>;

  // Sets what is kept in the files; one that is damaged is logged. `detectors` live until Shutdown.
  // `on_answer` is called on any thread for each new answer; it must neither block nor call back.
  DetectorLearner(LearningOptions options, Detectors detectors, std::function<void()> on_answer);
  ~DetectorLearner() { Shutdown(); }
  DetectorLearner(const DetectorLearner&) = delete;
  DetectorLearner& operator=(const DetectorLearner&) = delete;

  // Each request gets one answer, soon. Beyond 64 that wait the oldest are dropped.
  void Request(DetectorRequest request);
  // None: no answer is ready.
  std::optional<DetectorAnswer> TakeAnswer();
  // Drops requests and answers, because the client has gone. What is being learnt goes on.
  void Forget();
  // After the return no detector is used and no answer is made.
  void Shutdown();

 private:
  using Clock = std::chrono::steady_clock;
  // One camera's; for thread_, but for what says otherwise.
  struct Learning {
    DetectorControl* detector = nullptr;
    DetectorLearning progress;
    std::unique_ptr<LearningTask> task;  // while it runs
    Clock::duration interval{};
    Clock::time_point next_frame;
    Clock::time_point give_up;
    bool asked = false;
    std::optional<PreviewFrame> frame;  // with mutex_
  };

  void Run();
  DetectorAnswer Answer(const DetectorRequest& request);
  absl::Status Do(const DetectorRequest& request, DetectorControl* detector, Learning* learning);
  absl::Status Begin(const DetectorRequest& request, DetectorControl* detector, Learning* learning);
  // One step of it, without mutex_.
  void Step(Learning* learning, std::optional<PreviewFrame> frame);
  void Take(Learning* learning, const PreviewFrame& frame);
  void End(Learning* learning, const absl::StatusOr<std::string>& result);

  const LearningOptions options_;
  const Detectors detectors_;
  const std::function<void()> on_answer_;

  // A tap's lock is held while a frame is handed over with this one: no tap is called with it held.
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::string, Learning> learnings_;  // by camera; its entries are made at the beginning
  std::deque<DetectorRequest> requests_;
  std::deque<DetectorAnswer> answers_;
  bool shut_down_ = false;
  std::thread thread_;
};

}  // namespace rigcal::agent
