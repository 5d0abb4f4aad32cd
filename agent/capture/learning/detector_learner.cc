// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/learning/detector_learner.h"

#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "absl/strings/str_cat.h"
#include "agent/capture/learning/kept_detector.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr size_t kMaxWaiting = 64;
constexpr int kNice = 10;
// How often to look whether the capture still runs.
constexpr std::chrono::milliseconds kLookInterval{200};

template <typename T>
void PushBounded(T value, std::deque<T>* queue) {
  if (queue->size() >= kMaxWaiting) queue->pop_front();
  queue->push_back(std::move(value));
}

std::string_view NameOf(DetectorLearning::Kind kind) {
  return kind == DetectorLearning::Kind::kMask ? "a mask" : "the wand's colour";
}

}  // namespace

DetectorLearner::DetectorLearner(LearningOptions options, Detectors detectors,
                                 std::function<void()> on_answer)
    : options_(std::move(options)),
      detectors_(std::move(detectors)),
      on_answer_(std::move(on_answer)) {
  for (const auto& [camera, detector] : detectors_) {
    if (detector == nullptr) continue;
    learnings_[camera].detector = detector;
    const absl::Status status = RestoreDetector(options_.folder, detector);
    if (!status.ok()) spdlog::error("{}", std::string(status.message()));
  }
  thread_ = std::thread([this] { Run(); });
}

void DetectorLearner::Shutdown() {
  {
    const std::lock_guard lock(mutex_);
    shut_down_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
  for (auto& [camera, learning] : learnings_) learning.detector->frames().Cancel();
}

void DetectorLearner::Request(DetectorRequest request) {
  {
    const std::lock_guard lock(mutex_);
    PushBounded(std::move(request), &requests_);
  }
  changed_.notify_all();
}

std::optional<DetectorAnswer> DetectorLearner::TakeAnswer() {
  const std::lock_guard lock(mutex_);
  if (answers_.empty()) return std::nullopt;
  DetectorAnswer answer = std::move(answers_.front());
  answers_.pop_front();
  return answer;
}

void DetectorLearner::Forget() {
  const std::lock_guard lock(mutex_);
  requests_.clear();
  answers_.clear();
}

void DetectorLearner::Run() {
  // Of this thread alone, on Linux: frames are detected first.
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNice);
  std::unique_lock lock(mutex_);
  while (!shut_down_) {
    if (!requests_.empty()) {
      const DetectorRequest request = std::move(requests_.front());
      requests_.pop_front();
      lock.unlock();
      DetectorAnswer answer = Answer(request);
      lock.lock();
      PushBounded(std::move(answer), &answers_);
      on_answer_();
      continue;
    }
    bool runs = false;
    for (auto& [camera, learning] : learnings_) {
      if (learning.task == nullptr) {
        learning.frame.reset();  // of a learning that has ended
        continue;
      }
      runs = true;
      std::optional<PreviewFrame> frame = std::exchange(learning.frame, std::nullopt);
      lock.unlock();
      Step(&learning, std::move(frame));
      lock.lock();
    }
    const auto news = [this] {
      return shut_down_ || !requests_.empty() ||
             std::any_of(learnings_.begin(), learnings_.end(),
                         [](const auto& one) { return one.second.frame.has_value(); });
    };
    if (!runs) {
      changed_.wait(lock, news);
      continue;
    }
    Clock::time_point next = Clock::now() + kLookInterval;
    for (const auto& [camera, learning] : learnings_) {
      if (learning.task != nullptr && !learning.asked) next = std::min(next, learning.next_frame);
    }
    changed_.wait_until(lock, next, news);
  }
}

DetectorAnswer DetectorLearner::Answer(const DetectorRequest& request) {
  DetectorAnswer answer{.request_id = request.request_id, .status = {}, .state = {}};
  const auto found = detectors_.find(request.camera);
  if (found == detectors_.end()) {
    answer.status = absl::NotFoundError(absl::StrCat("this agent has no camera ", request.camera));
    return answer;
  }
  DetectorControl* const detector = found->second;
  if (detector == nullptr) {
    answer.status = absl::FailedPreconditionError(
        absl::StrCat("camera ", request.camera,
                     " has no frames, so that it has neither a mask nor a colour: it is an event "
                     "camera, or its source yields observations"));
    return answer;
  }
  Learning& learning = learnings_.at(request.camera);
  answer.status = Do(request, detector, &learning);
  if (!answer.status.ok()) return answer;
  const PixelMask ignored = detector->ignored();
  const ImageSize& size = detector->camera().image_size_px;
  const double pixels = 1.0 * size.width * size.height;
  answer.state.colour = detector->colour();
  answer.state.colour_learnt = detector->learnt_colour().has_value();
  answer.state.mask_learnt = detector->learnt_mask().width() > 0;
  answer.state.ignored_pixel_count = static_cast<uint32_t>(ignored.CountPixels());
  answer.state.ignored_share =
      pixels > 0 ? std::min(1.0, answer.state.ignored_pixel_count / pixels) : 0;
  if (learning.progress.wanted_frame_count > 0) answer.state.learning = learning.progress;
  return answer;
}

absl::Status DetectorLearner::Do(const DetectorRequest& request, DetectorControl* detector,
                                 Learning* learning) {
  if (request.command == DetectorCommand::kGet) return absl::OkStatus();
  if (learning->task != nullptr) {
    return absl::FailedPreconditionError(absl::StrCat(
        "camera ", request.camera, " learns ", std::string(NameOf(learning->progress.kind)),
        " now, from ", learning->progress.frame_count, " of ",
        learning->progress.wanted_frame_count, " frames so far; try again when it has ended"));
  }
  switch (request.command) {
    case DetectorCommand::kClearMask:
      detector->SetMask({});
      break;
    case DetectorCommand::kSetColour:
      if (request.colour) RIGCAL_RETURN_IF_ERROR(request.colour->Validate());
      detector->SetColour(request.colour);
      break;
    default:
      return Begin(request, detector, learning);
  }
  spdlog::info("camera {}: the {} of the detector is {}", request.camera,
               request.command == DetectorCommand::kClearMask ? "learnt mask" : "colour",
               request.command == DetectorCommand::kClearMask ? "forgotten" : "set");
  return KeepDetector(options_.folder, *detector);
}

absl::Status DetectorLearner::Begin(const DetectorRequest& request, DetectorControl* detector,
                                    Learning* learning) {
  const bool is_mask = request.command == DetectorCommand::kLearnMask;
  if (request.frame_count > options_.max_frames) {
    return absl::InvalidArgumentError(absl::StrCat(
        "frame_count is ", request.frame_count, ", at most ", options_.max_frames, " are allowed"));
  }
  const std::optional<Target> target = detector->target();
  if (!target) {
    return absl::FailedPreconditionError(
        absl::StrCat("camera ", request.camera,
                     " takes frames only while a session captures; start one, then learn"));
  }
  RIGCAL_ASSIGN_OR_RETURN(learning->task,
                          is_mask ? MakeMaskTask(*detector) : MakeColourTask(*detector, *target));
  const uint32_t frames = is_mask ? options_.mask_frames : options_.colour_frames;
  learning->progress = {
      .kind = is_mask ? DetectorLearning::Kind::kMask : DetectorLearning::Kind::kColour,
      .state = DetectorLearning::State::kRunning,
      .frame_count = 0,
      .wanted_frame_count = request.frame_count > 0 ? request.frame_count : frames,
      .wand_count = 0,
      .message = {}};
  learning->interval =
      (is_mask ? options_.mask_span : options_.colour_span) / learning->progress.wanted_frame_count;
  learning->next_frame = Clock::now();
  learning->give_up = Clock::now() + options_.time_limit;
  learning->asked = false;
  return absl::OkStatus();
}

void DetectorLearner::Step(Learning* learning, std::optional<PreviewFrame> frame) {
  const Clock::time_point now = Clock::now();
  if (frame) Take(learning, *frame);
  if (learning->task == nullptr) return;
  const DetectorLearning& progress = learning->progress;
  const std::string so_far =
      absl::StrCat(progress.frame_count, " of ", progress.wanted_frame_count, " frames");
  if (!learning->detector->target()) {
    return End(learning, absl::FailedPreconditionError(absl::StrCat(
                             "the capture ended after ", so_far, "; nothing has changed")));
  }
  if (now >= learning->give_up) {
    return End(learning, absl::FailedPreconditionError(absl::StrCat(
                             "only ", so_far, " came within ",
                             std::chrono::duration<double>(options_.time_limit).count(),
                             " s: is the camera triggered? Nothing has changed")));
  }
  if (learning->asked || now < learning->next_frame) return;
  learning->asked = true;
  learning->next_frame = now + learning->interval;
  learning->detector->frames().Request([this, learning](PreviewFrame taken) {
    const std::lock_guard lock(mutex_);
    learning->frame = std::move(taken);
    changed_.notify_all();
  });
}

void DetectorLearner::Take(Learning* learning, const PreviewFrame& frame) {
  learning->asked = false;
  if (learning->task == nullptr) return;
  DetectorLearning& progress = learning->progress;
  try {
    if (absl::Status status = learning->task->Add(frame); !status.ok()) {
      return End(learning, std::move(status));
    }
    ++progress.frame_count;
    if (frame.detection.outcome == DetectionOutcome::kWand) ++progress.wand_count;
    if (progress.frame_count < progress.wanted_frame_count) return;
    absl::StatusOr<std::string> result = learning->task->Finish(learning->detector);
    if (result.ok()) {
      const absl::Status kept = KeepDetector(options_.folder, *learning->detector);
      if (!kept.ok()) {
        absl::StrAppend(&*result,
                        "; it is in use until the agent ends: ", std::string(kept.message()));
        spdlog::error("camera {}: {}", learning->detector->camera().camera,
                      std::string(kept.message()));
      }
    }
    End(learning, result);
  } catch (const std::exception& error) {
    End(learning, absl::InternalError(error.what()));
  }
}

void DetectorLearner::End(Learning* learning, const absl::StatusOr<std::string>& result) {
  learning->detector->frames().Cancel();
  learning->task.reset();
  DetectorLearning& progress = learning->progress;
  progress.state =
      result.ok() ? DetectorLearning::State::kSucceeded : DetectorLearning::State::kFailed;
  progress.message = result.ok() ? *result : std::string(result.status().message());
  spdlog::info("camera {}: learning {}: {}", learning->detector->camera().camera,
               NameOf(progress.kind), progress.message);
}

}  // namespace rigcal::agent
