// SPDX-License-Identifier: Apache-2.0
// Searches pictures for the wand as `rigcal-agent detect` does, and prints what that does not: a
// line for each picture with the CPU time in ms, and x y cxx cxy cyy (px, px^2) for each marker,
// "nan" where it is not seen. Each picture is a capture of its own, searched without tracking. It
// is searched three times, and the median of the times counts.
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/capture/detecting_observation_source.h"
#include "agent/capture/frame_source.h"
#include "agent/command/frame_input.h"
#include "common/status/status_macros.h"
#include "common/target/observation.h"
#include "common/target/target.h"
#include "tests/accuracy/thread_cpu.h"

namespace rigcal::agent {
namespace {

// Measures the time of reading, which does not count.
class TimedFrames : public FrameSource {
 public:
  TimedFrames(std::unique_ptr<FrameSource> frames, double* read_s)
      : frames_(std::move(frames)), read_s_(read_s) {}

  const CameraDescription& description() const override { return frames_->description(); }
  absl::Status Start(const Target& target) override { return frames_->Start(target); }
  absl::StatusOr<std::optional<Frame>> Next() override {
    const double begin_s = accuracy::ThreadCpuS();
    auto frame = frames_->Next();
    *read_s_ += accuracy::ThreadCpuS() - begin_s;
    return frame;
  }
  void Stop() override { frames_->Stop(); }
  FrameCounts counts() const override { return frames_->counts(); }

 private:
  const std::unique_ptr<FrameSource> frames_;
  double* const read_s_;
};

struct Searched {
  double cpu_s = 0;
  Observation seen;
};

absl::StatusOr<Searched> Search(const FrameInput& input, const Target& target) {
  RIGCAL_ASSIGN_OR_RETURN(const auto spec, ResolveFrameInput(input));
  spec->detecting.detector.tracking = false;
  RIGCAL_ASSIGN_OR_RETURN(auto frames, spec->Make());
  double read_s = 0;
  RIGCAL_ASSIGN_OR_RETURN(
      const auto source,
      DetectingObservationSource::Create(std::make_unique<TimedFrames>(std::move(frames), &read_s),
                                         spec->detecting));
  Searched searched;
  std::array<double, 3> times_s;
  for (double& time_s : times_s) {
    RIGCAL_RETURN_IF_ERROR(source->Start(target));
    read_s = 0;
    const double begin_s = accuracy::ThreadCpuS();
    RIGCAL_ASSIGN_OR_RETURN(std::optional<Observation> seen, source->Next());
    time_s = accuracy::ThreadCpuS() - begin_s - read_s;
    if (!seen) return absl::DataLossError(input.input + " holds no picture");
    searched.seen = *std::move(seen);
  }
  std::ranges::sort(times_s);
  searched.cpu_s = times_s[1];
  return searched;
}

void Print(const Searched& searched, int marker_count) {
  std::printf("%.4f", 1e3 * searched.cpu_s);
  for (int m = 0; m < marker_count; ++m) {
    const auto index = static_cast<size_t>(m);
    if (index >= searched.seen.markers.size() || !searched.seen.markers[index].visible) {
      std::printf(" nan nan nan nan nan");
      continue;
    }
    const MarkerObservation& marker = searched.seen.markers[index];
    std::printf(" %.6f %.6f %.9g %.9g %.9g", marker.centre_px.x(), marker.centre_px.y(),
                marker.covariance_px2(0, 0), marker.covariance_px2(0, 1),
                marker.covariance_px2(1, 1));
  }
  std::printf("\n");
}

absl::Status SearchAll(FrameInput input, const std::string& target_text,
                       const std::vector<std::string>& pictures) {
  RIGCAL_ASSIGN_OR_RETURN(const Target target, ParseTarget(target_text));
  for (const std::string& picture : pictures) {
    input.input = picture;
    RIGCAL_ASSIGN_OR_RETURN(const Searched searched, Search(input, target));
    Print(searched, target.marker_count());
  }
  return absl::OkStatus();
}

}  // namespace
}  // namespace rigcal::agent

int main(int argc, char** argv) {
  rigcal::agent::FrameInput input;
  input.fps = "10";
  std::string target;
  std::vector<std::string> pictures;
  CLI::App app("Prints the wand's markers in pictures, their covariance, and the CPU time.");
  app.add_option("--calibration", input.calibration, "OpenCV YAML of the camera")->required();
  app.add_option("--target", target, "the wand")->required();
  app.add_option("--set", input.settings, "OPTION=VALUE of the frames, such as exposure=0.005")
      ->allow_extra_args(false);
  app.add_option("PICTURE", pictures)->required();
  CLI11_PARSE(app, argc, argv);
  spdlog::set_default_logger(spdlog::stderr_logger_mt("detect-probe"));
  const absl::Status status = rigcal::agent::SearchAll(input, target, pictures);
  if (status.ok()) return 0;
  std::fprintf(stderr, "%s\n", std::string(status.message()).c_str());
  return 1;
}
