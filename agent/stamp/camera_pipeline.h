// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/observation_source.h"
#include "agent/spool/observation_spool.h"

namespace rigcal::agent {

// One camera's thread: moves the source's observations into the spool, and ends the stream there
// with a report of what the source refused. One capture at a time: a second one waits
// its turn.
//
// Knows no network. Begin, End and the getters may be called by any thread.
class CameraPipeline {
 public:
  // `on_progress` is called on any thread now and then, and at each end of a capture; it must
  // neither block nor call back. `spool` outlives the pipeline.
  CameraPipeline(std::unique_ptr<ObservationSource> source, ObservationSpool* spool,
                 std::function<void()> on_progress)
      : source_(std::move(source)), spool_(spool), on_progress_(std::move(on_progress)) {}
  ~CameraPipeline() { Shutdown(); }
  CameraPipeline(const CameraPipeline&) = delete;
  CameraPipeline& operator=(const CameraPipeline&) = delete;

  void Start() {
    thread_ = std::thread([this] { Run(); });
  }
  // Ends every capture and joins the thread. A thread that waits for space in the spool is freed
  // only by the spool: shut that down first, or give it room.
  void Shutdown();

  const CameraDescription& description() const { return source_->description(); }
  // As ObservationSource::preview_tap.
  PreviewTap* preview_tap() const { return source_->preview_tap(); }
  DetectorControl* detector_control() const { return source_->detector_control(); }

  // Opens `stream` in the spool, numbered from `first_seq`, and captures `target` into it.
  // ALREADY_EXISTS: the stream is in the spool, so this has been done before.
  absl::Status Begin(const StreamKey& stream, const Target& target, uint32_t first_seq);
  // Ends the capture of this session, or of every session. One that runs ends soon, one that waits
  // its turn at once and empty; each stream gets its end in the spool. Unknown sessions change
  // nothing.
  void End(const std::string& session_id);
  void EndAll();
  // Sessions with a capture that runs or waits and has not been asked to end.
  std::vector<std::string> Sessions() const;

  // Totals of the capture that runs, at most about a second old.
  std::optional<CameraReport> RunningReport() const;
  void WaitUntilIdle();

 private:
  struct Capture {
    StreamKey stream;
    Target target;
    bool stop = false;
  };

  void Run();
  void RunCapture(const StreamKey& stream, const Target& target);
  // `*reason`: of an error.
  absl::Status MoveObservations(const StreamKey& stream, const Target& target,
                                RefusalReason* reason);
  bool StopRequested() const;
  CameraReport MakeReport() const;
  void EndIf(const std::function<bool(const Capture&)>& condition);

  const std::unique_ptr<ObservationSource> source_;
  ObservationSpool* const spool_;
  const std::function<void()> on_progress_;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Capture> captures_;  // the front one runs when running_
  bool running_ = false;
  bool shut_down_ = false;
  CameraReport report_;
  std::thread thread_;
};

// By the camera's name.
using CameraPipelines = std::map<std::string, std::unique_ptr<CameraPipeline>>;

// One for each source, not started. INVALID_ARGUMENT: two of one name.
absl::StatusOr<CameraPipelines> MakePipelines(
    std::vector<std::unique_ptr<ObservationSource>> sources, ObservationSpool* spool,
    const std::function<void()>& on_progress);

}  // namespace rigcal::agent
