// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/preview/preview_worker.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "agent/detect/frame/annotated_image.h"

namespace rigcal::agent {
namespace {

constexpr uint32_t kMaxWaitMs = 60'000;
// Answers that nobody fetches; the oldest are dropped.
constexpr size_t kMaxAnswers = 64;

Preview Refusal(const PreviewRequest& request, PreviewStatus status, std::string message) {
  Preview preview;
  preview.request_id = request.request_id;
  preview.status = status;
  preview.message = std::move(message);
  return preview;
}

Preview TimedOut(const PreviewRequest& request) {
  return Refusal(
      request, PreviewStatus::kTimedOut,
      absl::StrCat("camera ", request.camera, " took no frame within ", request.max_wait_ms,
                   " ms: is it triggered, and has its recording not ended?"));
}

}  // namespace

PreviewWorker::PreviewWorker(PreviewOptions options, std::function<void()> on_answer)
    : options_(options), on_answer_(std::move(on_answer)) {
  thread_ = std::thread([this] { Run(); });
}

void PreviewWorker::Shutdown() {
  Forget();
  {
    const std::lock_guard lock(mutex_);
    shut_down_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void PreviewWorker::Forget() {
  std::vector<PreviewTap*> taps;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [camera, waiting] : waiting_) taps.push_back(waiting.tap);
    waiting_.clear();
    answers_.clear();
  }
  for (PreviewTap* tap : taps) tap->Cancel();
}

std::optional<Preview> PreviewWorker::Refused(const PreviewRequest& request,
                                              const PreviewSubject& subject) {
  const std::string camera = absl::StrCat("camera ", request.camera);
  const auto refuse = [&](PreviewStatus status, const auto&... why) {
    return Refusal(request, status, absl::StrCat(why...));
  };
  if (!subject.known) return refuse(PreviewStatus::kUnknownCamera, "this agent has no ", camera);
  if (!options_.enabled) {
    return refuse(PreviewStatus::kDisabled, "previews are off at the agent of ", camera,
                  "; they are switched on with enabled = true under [preview] in its "
                  "configuration file");
  }
  if (subject.tap == nullptr) {
    return refuse(PreviewStatus::kNoFrames, camera,
                  " has no frames: its source yields observations");
  }
  if (!subject.capturing) {
    return refuse(PreviewStatus::kNotCapturing, camera,
                  " takes frames only while a session captures; start one with rigcal session "
                  "start");
  }
  if (waiting_.contains(request.camera)) {
    return refuse(PreviewStatus::kTooOften, "a preview of ", camera,
                  " is under way; ask again when it is there");
  }
  if (const auto last = last_asked_.find(request.camera); last != last_asked_.end()) {
    const std::chrono::duration<double> wait =
        last->second + std::chrono::duration<double>(1 / options_.max_rate_hz) - Clock::now();
    if (wait.count() > 0) {
      return refuse(
          PreviewStatus::kTooOften,
          absl::StrFormat("the agent of %s allows %g previews/s (max_rate_hz); ask again in %.1f s",
                          camera, options_.max_rate_hz, std::ceil(wait.count() * 10) / 10));
    }
  }
  return std::nullopt;
}

void PreviewWorker::Request(const PreviewRequest& request, const PreviewSubject& subject) {
  {
    const std::lock_guard lock(mutex_);
    if (shut_down_) return;
    if (std::optional<Preview> refused = Refused(request, subject)) {
      Answer(*std::move(refused));
      return;
    }
    const Clock::time_point now = Clock::now();
    last_asked_[request.camera] = now;
    const auto wait = std::chrono::milliseconds(std::min(request.max_wait_ms, kMaxWaitMs));
    waiting_[request.camera] = {
        .request = request, .tap = subject.tap, .deadline = now + wait, .frame = {}};
  }
  subject.tap->Request([this, camera = request.camera, id = request.request_id](
                           PreviewFrame frame) { TakeFrame(camera, id, std::move(frame)); });
  changed_.notify_all();
}

void PreviewWorker::TakeFrame(const std::string& camera, uint32_t request_id, PreviewFrame frame) {
  const std::lock_guard lock(mutex_);
  const auto found = waiting_.find(camera);
  if (found == waiting_.end() || found->second.request.request_id != request_id) return;
  found->second.frame = std::move(frame);
  changed_.notify_all();
}

std::optional<Preview> PreviewWorker::TakeAnswer() {
  const std::lock_guard lock(mutex_);
  if (answers_.empty()) return std::nullopt;
  Preview preview = std::move(answers_.front());
  answers_.pop_front();
  return preview;
}

// With mutex_ held.
void PreviewWorker::Answer(Preview preview) {
  if (answers_.size() >= kMaxAnswers) answers_.pop_front();
  answers_.push_back(std::move(preview));
  on_answer_();
}

void PreviewWorker::Run() {
  std::unique_lock lock(mutex_);
  while (!shut_down_) {
    const Clock::time_point now = Clock::now();
    Clock::time_point next = now + std::chrono::hours(1);
    Waiting* due = nullptr;
    for (auto& [camera, waiting] : waiting_) {
      if (waiting.frame || waiting.deadline <= now) due = &waiting;
      next = std::min(next, waiting.deadline);
    }
    if (due == nullptr) {
      changed_.wait_until(lock, next);
    } else {
      Finish(lock, due);
    }
  }
}

void PreviewWorker::Finish(std::unique_lock<std::mutex>& lock, Waiting* due) {
  const PreviewRequest request = due->request;
  PreviewTap* const tap = due->tap;
  const std::optional<PreviewFrame> frame = std::exchange(due->frame, std::nullopt);
  // What is done below ends by itself. The entry stays, so that no second request comes between.
  due->deadline = Clock::time_point::max();
  lock.unlock();
  if (!frame) tap->Cancel();
  Preview answer = frame ? Draw(request, *frame) : TimedOut(request);
  lock.lock();
  const auto still = waiting_.find(request.camera);
  // It was forgotten meanwhile.
  if (still == waiting_.end() || still->second.request.request_id != request.request_id) return;
  waiting_.erase(still);
  Answer(std::move(answer));
}

Preview PreviewWorker::Draw(const PreviewRequest& request, const PreviewFrame& frame) const {
  Preview preview;
  preview.request_id = request.request_id;
  try {
    const size_t max_bytes = request.max_jpeg_bytes == 0 ? options_.max_jpeg_bytes
                                                         : std::min<size_t>(options_.max_jpeg_bytes,
                                                                            request.max_jpeg_bytes);
    absl::StatusOr<JpegImage> jpeg =
        EncodeJpeg(Annotate(frame.image, frame.detection, frame.window, frame.blobs), max_bytes);
    if (!jpeg.ok()) {
      return Refusal(request, PreviewStatus::kFailed, std::string(jpeg.status().message()));
    }
    const Detection& detection = frame.detection;
    preview.info = {
        .camera = request.camera,
        .time_ns = frame.time_ns,
        .clock_epoch = frame.clock_epoch,
        .image_size_px = {static_cast<uint32_t>(frame.image.width),
                          static_cast<uint32_t>(frame.image.height)},
        .jpeg_size_px = {static_cast<uint32_t>(jpeg->width), static_cast<uint32_t>(jpeg->height)},
        .outcome = detection.outcome,
        // A frame is worth seeing with a confidence that is no number, too.
        .confidence =
            std::isnan(detection.confidence) ? 0 : std::clamp(detection.confidence, 0.0, 1.0),
        .visible_marker_count = static_cast<uint32_t>(detection.observation.VisibleCount()),
        .blob_count = static_cast<uint32_t>(std::max(0, detection.blob_count)),
        .tracked = detection.tracked};
    preview.jpeg = std::move(jpeg->bytes);
    return preview;
  } catch (const std::exception& error) {
    return Refusal(request, PreviewStatus::kFailed,
                   absl::StrCat("the frame could not be drawn: ", error.what()));
  }
}

}  // namespace rigcal::agent
