// SPDX-License-Identifier: Apache-2.0
#include "server/worker/worker.h"

#include <sys/resource.h>

#include <chrono>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "common/calibration/calibration_record.h"
#include "common/status/status_macros.h"
#include "common/wire/calibration_wire.h"
#include "server/solve/calibrate.h"
#include "server/solve/running/running_estimate.h"
#include "server/worker/estimate_messages.h"
#include "server/worker/heartbeat.h"
#include "server/worker/solve_input.h"

namespace rigcal::server {
namespace {

// Progress within a stage is written not more often than this.
constexpr std::chrono::milliseconds kProgressInterval{100};

uint64_t PeakMemoryBytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<uint64_t>(usage.ru_maxrss) * 1024;
}

// Writes what the server reads, from the solving thread and that of the heartbeat.
class OutputWriter {
 public:
  explicit OutputWriter(int out) : writer_(out) {}

  absl::Status Write(const google::protobuf::MessageLite& message) {
    const std::lock_guard lock(mutex_);
    RIGCAL_RETURN_IF_ERROR(writer_.Write(message));
    return writer_.Flush();
  }

 private:
  std::mutex mutex_;
  MessageWriter writer_;
};

// An error of the pipe shows when the outcome is written.
template <typename Output>
absl::StatusOr<std::unique_ptr<Heartbeat>> StartHeartbeat(OutputWriter* writer) {
  return Heartbeat::Start([writer] {
    Output message;
    message.mutable_heartbeat();
    (void)writer->Write(message);
  });
}

// Writes progress; an error of the pipe shows when the outcome is written.
class ProgressWriter {
 public:
  explicit ProgressWriter(OutputWriter* writer) : writer_(writer) {}

  void Report(CalibrationStage stage, double fraction) {
    const auto now = std::chrono::steady_clock::now();
    if (stage == stage_ && now - last_ < kProgressInterval) return;
    stage_ = stage;
    last_ = now;
    worker::v1::SolveOutput message;
    message.mutable_progress()->set_stage(static_cast<v1::CalibrationStage>(stage));
    message.mutable_progress()->set_fraction(fraction);
    (void)writer_->Write(message);
  }

 private:
  OutputWriter* const writer_;
  CalibrationStage stage_ = CalibrationStage::kUnspecified;
  std::chrono::steady_clock::time_point last_;
};

worker::v1::SolveOutput OutcomeMessage(CalibrationOutcome outcome) {
  Calibration calibration;
  worker::v1::SolveOutput message;
  message.mutable_outcome()->set_code(static_cast<uint32_t>(outcome.result.status().code()));
  if (outcome.result.ok()) {
    calibration.state = CalibrationState::kSucceeded;
    calibration.result = *std::move(outcome.result);
  } else {
    calibration.state = CalibrationState::kFailed;
    calibration.error = std::string(outcome.result.status().message());
    calibration.refused = std::move(outcome.refused);
  }
  message.mutable_outcome()->set_calibration(wire::SerializeCalibration(calibration));
  message.mutable_outcome()->set_peak_memory_bytes(PeakMemoryBytes());
  return message;
}

}  // namespace

absl::Status RunWorker(int in, int out) {
  OutputWriter writer(out);
  RIGCAL_ASSIGN_OR_RETURN(std::unique_ptr<Heartbeat> heartbeat,
                          StartHeartbeat<worker::v1::SolveOutput>(&writer));
  RIGCAL_ASSIGN_OR_RETURN(SolveInput task, ReadSolveInput(in));
  ProgressWriter progress(&writer);
  CalibrationHooks hooks;
  hooks.progress = [&progress](CalibrationStage stage, double fraction) {
    progress.Report(stage, fraction);
  };
  CalibrationOutcome outcome = Calibrate(std::move(task.input), task.options, hooks);
  if (absl::IsResourceExhausted(outcome.result.status())) return outcome.result.status();
  // The outcome is the last message.
  const worker::v1::SolveOutput message = OutcomeMessage(std::move(outcome));
  heartbeat.reset();
  return writer.Write(message);
}

absl::Status RunEstimateWorker(int in, int out) {
  OutputWriter writer(out);
  RIGCAL_ASSIGN_OR_RETURN(std::unique_ptr<Heartbeat> heartbeat,
                          StartHeartbeat<worker::v1::EstimateOutput>(&writer));
  RIGCAL_ASSIGN_OR_RETURN(RunningInput input, ReadEstimateInput(in));
  const RunningOutcome outcome = EstimateNow(std::move(input));
  if (absl::IsResourceExhausted(outcome.problem)) return outcome.problem;
  worker::v1::EstimateOutput message = ToProto(outcome);
  message.set_peak_memory_bytes(PeakMemoryBytes());
  heartbeat.reset();
  return writer.Write(message);
}

}  // namespace rigcal::server
