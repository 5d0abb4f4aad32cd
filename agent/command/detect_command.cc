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
#include "agent/capture/static_mask.h"
#include "agent/command/detection_explanation.h"
#include "agent/command/detection_report.h"
#include "agent/command/frame_input.h"
#include "agent/command/marker_csv.h"
#include "agent/command/subcommands.h"
#include "agent/detect/frame/annotated_image.h"
#include "agent/event_files/event_file_writer.h"
#include "common/file/may_write.h"
#include "common/status/status_macros.h"
#include "common/target/target.h"

namespace rigcal::agent {
namespace {

namespace fs = std::filesystem;

struct DetectFlags {
  FrameInput input;
  std::string target;
  std::string out;
  bool force = false;
  std::string annotate;
  bool no_tracking = false;
  bool explain = false;
  uint64_t frames = 0;
  std::string format = "table";
};

// Where annotated images go: one file for one image, or a folder.
class Annotations {
 public:
  static absl::StatusOr<Annotations> Create(const std::string& path, bool force) {
    Annotations annotations(path, force);
    if (path.empty()) return annotations;
    if (IsImageName(path)) {
      RIGCAL_RETURN_IF_ERROR(CheckOutputFile(path, force, "--annotate"));
      return annotations;
    }
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
    RIGCAL_RETURN_IF_ERROR(CheckOutputFile(path, force_, "--annotate"));
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
  Annotations(std::string path, bool force) : path_(std::move(path)), force_(force) {}
  std::string path_;
  bool force_;
  int count_ = 0;
};

// A source of frames that measures the time to read each.
class TimedFrameSource : public FrameSource {
 public:
  explicit TimedFrameSource(std::unique_ptr<FrameSource> frames) : frames_(std::move(frames)) {}

  const CameraDescription& description() const override { return frames_->description(); }
  absl::Status Start(const Target& target) override { return frames_->Start(target); }
  absl::StatusOr<std::optional<Frame>> Next() override {
    const auto begin = std::chrono::steady_clock::now();
    absl::StatusOr<std::optional<Frame>> frame = frames_->Next();
    read_time_ = std::chrono::steady_clock::now() - begin;
    last_ = frame.ok() ? *frame : std::nullopt;
    return frame;
  }
  void Stop() override { frames_->Stop(); }
  std::vector<ClockSample> TakeClockSamples() override { return frames_->TakeClockSamples(); }
  FrameCounts counts() const override { return frames_->counts(); }
  std::vector<Refusal> Refused() const override { return frames_->Refused(); }

  // Of the last Next.
  std::chrono::duration<double> read_time() const { return read_time_; }
  const std::optional<Frame>& last() const { return last_; }

 private:
  const std::unique_ptr<FrameSource> frames_;
  std::chrono::duration<double> read_time_{0};
  std::optional<Frame> last_;
};

// Writes the detections of at most `limit` frames (0: all) to the CSV, where there is one, and the
// annotations.
absl::StatusOr<DetectionReport> RunDetector(const TimedFrameSource& frames, uint64_t limit,
                                            const Target& target,
                                            DetectingObservationSource* source, OutputFile* csv,
                                            Annotations* annotations) {
  DetectionReport report;
  uint64_t searched = 0;  // whole
  const auto begin = std::chrono::steady_clock::now();
  RIGCAL_RETURN_IF_ERROR(source->Start(target));
  for (uint64_t i = 0; limit == 0 || i < limit; ++i) {
    const auto before = std::chrono::steady_clock::now();
    const uint64_t seen_before = report.looked_at();
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<Observation> observation, source->Next());
    if (!observation) break;
    const std::chrono::duration<double> both = std::chrono::steady_clock::now() - before;
    report.reading.Add(frames.read_time().count());
    report.detections = *source->detection_counts();
    if (csv != nullptr) RIGCAL_RETURN_IF_ERROR(csv->Write(MarkerCsvLine(*observation)));
    for (const MarkerObservation& marker : observation->markers) {
      if (!marker.visible) continue;
      report.centres = marker.centre_kind == CentreKind::kSphereCentre ? "sphere" : "blob";
    }
    if (report.looked_at() == seen_before) {
      ++report.learning;
      continue;
    }
    report.detecting.Add((both - frames.read_time()).count());
    const Detection& last = source->last_detection();
    if (last.tracked) ++report.tracked;
    if (last.cut_short) ++report.cut_short;
    if (!last.tracked) {
      report.passed_share += last.passed_share;
      report.white_share += last.white_share;
      ++searched;
    }
    RIGCAL_RETURN_IF_ERROR(annotations->Add(*frames.last(), *source));
  }
  for (double* share : {&report.passed_share, &report.white_share}) {
    *share /= static_cast<double>(std::max<uint64_t>(1, searched));
  }
  report.exposure = source->exposure_facts();
  report.background_share = source->last_detection().background_share;
  report.resting_wands = source->resting_wands();
  report.frames = frames.counts();
  report.refused = source->Refused();
  report.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return report;
}

// Each frame by itself: what is around a wand that moves is not learnt.
absl::Status Explain(const DetectFlags& flags, const Target& target, const FrameSourceSpec& spec,
                     std::ostream& out) {
  if (!target.IsLine()) {
    return absl::InvalidArgumentError(
        "--explain says how candidates for a wand were judged; a board has none");
  }
  RIGCAL_ASSIGN_OR_RETURN(const std::unique_ptr<FrameSource> frames, spec.Make());
  RIGCAL_RETURN_IF_ERROR(frames->Start(target));
  const CameraDescription& camera = frames->description();
  WandDetectorOptions options = spec.detecting.detector;
  if (options.exposure_s <= 0 && camera.settings) options.exposure_s = camera.settings->exposure_s;
  RIGCAL_ASSIGN_OR_RETURN(WandDetector detector, WandDetector::Create(options, target, camera));
  if (!spec.detecting.mask_path.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(const PixelMask mask,
                            ReadMask(spec.detecting.mask_path, camera.image_size_px));
    detector.SetIgnored(mask);
  }
  uint64_t count = 0;
  for (; flags.frames == 0 || count < flags.frames; ++count) {
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<Frame> frame, frames->Next());
    if (!frame) break;
    RIGCAL_ASSIGN_OR_RETURN(const WandExplanation explanation, detector.Explain(frame->image));
    const std::string name = absl::StrCat("picture ", count + 1);
    out << (flags.format == "json" ? ExplanationJson(name, explanation, target)
                                   : FormatExplanation(name, explanation, target, options.min_confidence));
  }
  frames->Stop();
  return count > 0 ? absl::OkStatus() : absl::FailedPreconditionError("there were no frames");
}

absl::Status Detect(const DetectFlags& flags, std::ostream& out) {
  RIGCAL_ASSIGN_OR_RETURN(const Target target, ParseTarget(flags.target));
  RIGCAL_RETURN_IF_ERROR(CheckDetectable(target));
  if (!flags.out.empty()) RIGCAL_RETURN_IF_ERROR(CheckOutputFile(flags.out, flags.force));
  RIGCAL_ASSIGN_OR_RETURN(const auto spec, ResolveFrameInput(flags.input));
  if (flags.explain) {
    if (!flags.out.empty() || !flags.annotate.empty()) {
      return absl::InvalidArgumentError("--explain goes without --output and --annotate");
    }
    return Explain(flags, target, *spec, out);
  }
  if (flags.no_tracking) spec->detecting.detector.tracking = false;
  RIGCAL_ASSIGN_OR_RETURN(std::unique_ptr<FrameSource> frames, spec->Make());
  auto timed = std::make_unique<TimedFrameSource>(std::move(frames));
  const TimedFrameSource& timed_frames = *timed;
  RIGCAL_ASSIGN_OR_RETURN(const auto source,
                          DetectingObservationSource::Create(std::move(timed), spec->detecting));
  RIGCAL_ASSIGN_OR_RETURN(Annotations annotations,
                          Annotations::Create(flags.annotate, flags.force));
  std::optional<OutputFile> csv;
  if (!flags.out.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(csv, OutputFile::Create(flags.out));
  }
  RIGCAL_ASSIGN_OR_RETURN(const DetectionReport report,
                          RunDetector(timed_frames, flags.frames, target, source.get(),
                                      csv ? &*csv : nullptr, &annotations));
  if (csv) RIGCAL_RETURN_IF_ERROR(csv->Finish());
  out << (flags.format == "json" ? ReportJson(report) : FormatReport(report));
  if (report.frames.received > 0) return absl::OkStatus();
  return absl::FailedPreconditionError("there were no frames");
}

}  // namespace

void AddDetectCommand(CLI::App& app, Subcommands* all) {
  const auto [command, flags] =
      all->Add(app, "detect", "Finds the wand or board in an image, a folder or a video", &Detect);
  AddFrameInput(command, &flags.input);
  command
      .add_option("--target", flags.target,
                  "wand:0,0.13,0.39;diameter=0.04;hz=500, or board:checker,9x6,0.03")
      ->required();
  AddOutputOption(command, &flags.out, &flags.force,
                  "CSV for csv: (timestamp_ns;x0;y0;..., -1 = not seen), a line per frame");
  command.add_option("--annotate", flags.annotate,
                     "Folder for images with the detections drawn in; FILE.png for a single one");
  command.add_flag("--no-tracking", flags.no_tracking, "Search every frame completely");
  command.add_flag("--explain", flags.explain,
                   "Instead of a report: for each picture the likeliest candidates, what speaks "
                   "against each, and why the others were refused");
  command.add_option("--pictures", flags.frames, "Frames to search at most [all]");
  AddFormatOption(command, &flags.format, "table or json [table]");
  command.footer(
      "Examples:\n"
      "  rigcal-agent detect rig/left --target 'wand:0,0.13,0.39;diameter=0.04' --output left.csv\n"
      "  rigcal-agent detect one.png --target wand:0,0.13,0.39 --annotate seen.png\n"
      "  rigcal-agent detect one.png --target wand:0,0.13,0.39 --explain\n"
      "  rigcal-agent detect left.mkv --target wand:0,0.13,0.39 --set hue_max=40 -o json\n"
      "Exit codes: 0 ok, whether wands were found or not, 1 failed, 2 usage.");
}

}  // namespace rigcal::agent
