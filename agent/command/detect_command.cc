// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "agent/capture/detecting_observation_source.h"
#include "agent/capture/image_file.h"
#include "agent/command/detection_report.h"
#include "agent/command/frame_input.h"
#include "agent/command/marker_csv.h"
#include "agent/command/subcommands.h"
#include "agent/command/timed_frame_source.h"
#include "agent/detect/frame/annotated_image.h"
#include "common/status/status_macros.h"
#include "common/target/target.h"

namespace rigcal::agent {
namespace {

namespace fs = std::filesystem;

struct DetectFlags {
  FrameInput input;
  std::string target;
  std::string out;
  std::string annotate;
  bool no_tracking = false;
  uint64_t frames = 0;
  std::string format = "table";
};

// Where annotated images go: one file for one image, or a folder.
class Annotations {
 public:
  static absl::StatusOr<Annotations> Create(const std::string& path) {
    Annotations annotations(path);
    if (path.empty() || IsImageName(path)) return annotations;
    std::error_code error;
    fs::create_directories(path, error);
    if (!error) return annotations;
    return absl::PermissionDeniedError(
        absl::StrCat("cannot make the folder ", path, ": ", error.message()));
  }

  absl::Status Add(const Frame& frame, const DetectingObservationSource& source) {
    if (path_.empty()) return absl::OkStatus();
    const bool is_file = IsImageName(path_);
    if (is_file && count_ == 1) {
      return absl::InvalidArgumentError(
          absl::StrCat(path_, " is one image, but there are several frames: name a folder"));
    }
    const fs::path path =
        is_file ? fs::path(path_)
                : fs::path(path_) / absl::StrFormat("%06d_%019d.png", count_, frame.time_ns);
    ++count_;
    try {
      if (cv::imwrite(path.string(), Annotate(frame.image, source.last_detection(),
                                              source.last_window(), source.last_blobs()))) {
        return absl::OkStatus();
      }
    } catch (const cv::Exception&) {
    }
    return absl::PermissionDeniedError(absl::StrCat("cannot write ", path.string()));
  }

 private:
  explicit Annotations(std::string path) : path_(std::move(path)) {}
  std::string path_;
  int count_ = 0;
};

// Writes the detections of each frame to the report, the CSV and the annotations.
class Detecting {
 public:
  Detecting(TimedFrameSource* frames, DetectingObservationSource* source)
      : frames_(frames), source_(source) {}

  absl::Status Run(const Target& target, MarkerCsvWriter* csv, Annotations* annotations) {
    const auto begin = std::chrono::steady_clock::now();
    RIGCAL_RETURN_IF_ERROR(source_->Start(target));
    while (true) {
      const auto before = std::chrono::steady_clock::now();
      const uint64_t seen_before = report_.looked_at();
      RIGCAL_ASSIGN_OR_RETURN(const std::optional<Observation> observation, source_->Next());
      if (!observation) break;
      const std::chrono::duration<double> both = std::chrono::steady_clock::now() - before;
      report_.reading.Add(frames_->read_time().count());
      report_.detections = *source_->detection_counts();
      if (csv != nullptr) csv->Write(*observation);
      for (const MarkerObservation& marker : observation->markers) {
        if (!marker.visible) continue;
        report_.centres = marker.centre_kind == CentreKind::kSphereCentre ? "sphere" : "blob";
      }
      if (report_.looked_at() == seen_before) {
        ++report_.learning;
        continue;
      }
      report_.detecting.Add((both - frames_->read_time()).count());
      if (source_->last_detection().tracked) ++report_.tracked;
      RIGCAL_RETURN_IF_ERROR(annotations->Add(*frames_->last(), *source_));
    }
    report_.frames = frames_->counts();
    report_.refused = source_->Refused();
    report_.wall_s =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return absl::OkStatus();
  }
  const DetectionReport& report() const { return report_; }

 private:
  TimedFrameSource* const frames_;
  DetectingObservationSource* const source_;
  DetectionReport report_;
};

absl::Status Detect(const DetectFlags& flags, std::ostream& out) {
  RIGCAL_ASSIGN_OR_RETURN(const Target target, ParseTarget(flags.target));
  RIGCAL_ASSIGN_OR_RETURN(const auto spec, ResolveFrameInput(flags.input));
  if (flags.no_tracking) spec->detecting.detector.tracking = false;
  RIGCAL_ASSIGN_OR_RETURN(std::unique_ptr<FrameSource> frames, spec->Make());
  auto timed = std::make_unique<TimedFrameSource>(std::move(frames), flags.frames);
  TimedFrameSource* const timed_frames = timed.get();
  RIGCAL_ASSIGN_OR_RETURN(const auto source,
                          DetectingObservationSource::Create(std::move(timed), spec->detecting));
  RIGCAL_ASSIGN_OR_RETURN(Annotations annotations, Annotations::Create(flags.annotate));
  std::optional<MarkerCsvWriter> csv;
  if (!flags.out.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(csv, MarkerCsvWriter::Create(flags.out));
  }
  Detecting detecting(timed_frames, source.get());
  RIGCAL_RETURN_IF_ERROR(detecting.Run(target, csv ? &*csv : nullptr, &annotations));
  if (csv) RIGCAL_RETURN_IF_ERROR(csv->Close());
  out << (flags.format == "json" ? ReportJson(detecting.report())
                                 : FormatReport(detecting.report()));
  if (timed_frames->counts().received > 0) return absl::OkStatus();
  return absl::FailedPreconditionError("there were no frames");
}

}  // namespace

void AddDetectCommand(CLI::App& app, std::ostream& out, std::function<absl::Status()>* chosen) {
  CLI::App* const command =
      app.add_subcommand("detect", "Finds the wand in an image, a folder or a video");
  const auto flags = std::make_shared<DetectFlags>();
  AddFrameInput(*command, &flags->input);
  command->add_option("--target", flags->target, "wand:0,0.13,0.39;diameter=0.04;hz=500")
      ->required();
  command->add_option("--out", flags->out,
                      "CSV for csv: (timestamp_ns;x0;y0;..., -1 = not seen), a line per frame");
  command->add_option("--annotate", flags->annotate,
                      "Folder for images with the detections drawn in; FILE.png for a single one");
  command->add_flag("--no-tracking", flags->no_tracking, "Search every frame completely");
  command->add_option("--pictures", flags->frames, "At most so many [all]");
  command->add_option("-o,--output", flags->format, "table or json [table]")
      ->check(CLI::IsMember({"table", "json"}));
  command->footer(
      "Examples:\n"
      "  rigcal-agent detect rig/left --target 'wand:0,0.13,0.39;diameter=0.04' --out left.csv\n"
      "  rigcal-agent detect one.png --target wand:0,0.13,0.39 --annotate seen.png\n"
      "  rigcal-agent detect left.mkv --target wand:0,0.13,0.39 --set hue_max=40 -o json\n"
      "Exit codes: 0 ok, whether wands were found or not, 1 failed, 2 usage.");
  command->callback(
      [flags, chosen, &out] { *chosen = [flags, &out] { return Detect(*flags, out); }; });
}

}  // namespace rigcal::agent
