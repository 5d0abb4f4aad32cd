// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "agent/capture/pacer.h"
#include "agent/capture/registry/source_registry.h"
#include "agent/capture/simulated/simulated_event_source.h"
#include "agent/command/marker_csv.h"
#include "agent/command/subcommands.h"
#include "agent/event/evt3_writer.h"
#include "agent/event_files/event_file_writer.h"
#include "common/camera/camera_export.h"
#include "common/file/may_write.h"
#include "common/status/status_macros.h"
#include "common/target/target.h"

namespace rigcal::agent {
namespace {

// EVT 3.0 counts up to here before it overflows; readers start below.
constexpr int64_t kOverflowUs = int64_t{1} << 24;

struct SimulateFlags {
  std::string source;
  std::string out;
  bool force = false;
  std::string target = "wand:0,0.13,0.39;diameter=0.04;hz=500";
  double truth_hz = 200;
};

absl::StatusOr<SimulatedEventSourceOptions> OptionsOf(const std::string& text) {
  RIGCAL_ASSIGN_OR_RETURN(const auto spec, ParseSourceSpec(text));
  const auto* const simulated =
      dynamic_cast<const HasOptions<SimulatedEventSourceOptions>*>(spec.get());
  if (simulated == nullptr) {
    return absl::InvalidArgumentError(absl::StrCat("\"", text,
                                                   "\" is not a simulated event camera; example: "
                                                   "\"sim:camera=0;events=1;duration=2\""));
  }
  SimulatedEventSourceOptions options = simulated->options;
  options.speed = kMaxSpeed;
  return options;
}

Observation TruthAt(const SimulatedEventSource& source, int64_t time_us) {
  Observation truth;
  truth.time_ns = 1000 * time_us;
  for (const MarkerGroundTruth& marker : source.TruthAt(time_us)) {
    truth.markers.push_back({.visible = marker.inside, .centre_px = marker.centre_px});
  }
  return truth;
}

absl::Status WriteCalibration(const std::string& path, const SimulatedEventSource& source,
                              const SimulatedEventSourceOptions& options, const Target& target) {
  RIGCAL_ASSIGN_OR_RETURN(const auto world, SharedWorld(options.simulation, target));
  CameraExport camera;
  camera.camera = source.description().camera;
  camera.image_size_px = source.description().image_size_px;
  camera.intrinsics = *source.description().intrinsics;
  camera.cam_from_rig = world->cameras()[static_cast<size_t>(options.camera_index)].cam_from_rig;
  return WriteCameraExport(path, camera);
}

absl::Status Simulate(const SimulateFlags& flags, std::ostream& out) {
  const std::filesystem::path raw_path = flags.out;
  if (raw_path.extension() != ".raw") {
    return absl::InvalidArgumentError(
        absl::StrCat(flags.out, " must end in .raw: only RAW files are written"));
  }
  std::filesystem::path truth_path = raw_path, calibration_path = raw_path;
  truth_path.replace_extension(".csv");
  calibration_path.replace_extension(".yaml");
  for (const std::filesystem::path& path : {raw_path, truth_path, calibration_path}) {
    RIGCAL_RETURN_IF_ERROR(CheckOutputFile(path, flags.force));
  }
  RIGCAL_ASSIGN_OR_RETURN(const Target target, ParseTarget(flags.target));
  RIGCAL_ASSIGN_OR_RETURN(const SimulatedEventSourceOptions options, OptionsOf(flags.source));
  RIGCAL_ASSIGN_OR_RETURN(const auto source, SimulatedEventSource::Create(options));
  RIGCAL_RETURN_IF_ERROR(source->Start(target));
  if (source->time_us() >= kOverflowUs) {
    return absl::InvalidArgumentError(absl::StrCat("the camera's clock begins at ",
                                                   source->time_us(),
                                                   " us, but a RAW file must begin before 16.8 s"));
  }
  RIGCAL_ASSIGN_OR_RETURN(OutputFile raw, OutputFile::Create(flags.out));
  RIGCAL_ASSIGN_OR_RETURN(OutputFile truth, OutputFile::Create(truth_path.string()));
  const ImageSize size = source->description().image_size_px;
  const std::string header = Evt3Header({size.width, size.height}, "simulated");
  RIGCAL_RETURN_IF_ERROR(raw.Write(header));
  const auto output_us = [&flags](int64_t k) {
    return std::llround(1e6 * static_cast<double>(k) / flags.truth_hz);
  };
  auto next = static_cast<int64_t>(
      std::ceil(1e-6 * static_cast<double>(source->time_us()) * flags.truth_hz));
  uint64_t bytes = header.size();
  int64_t rows = 0;
  while (true) {
    RIGCAL_ASSIGN_OR_RETURN(const std::optional<EventChunk> chunk, source->Next());
    if (!chunk) break;
    RIGCAL_RETURN_IF_ERROR(raw.Write(chunk->bytes));
    bytes += chunk->bytes.size();
    for (; output_us(next) <= source->time_us(); ++next, ++rows) {
      RIGCAL_RETURN_IF_ERROR(truth.Write(MarkerCsvLine(TruthAt(*source, output_us(next)))));
    }
  }
  RIGCAL_RETURN_IF_ERROR(raw.Finish());
  RIGCAL_RETURN_IF_ERROR(truth.Finish());
  RIGCAL_RETURN_IF_ERROR(WriteCalibration(calibration_path.string(), *source, options, target));
  out << absl::StrCat(flags.out, ": ", bytes, " bytes of EVT 3.0, ", size.width, "x", size.height,
                      "\n", truth_path.string(), ": where the markers are, ", rows, " times\n",
                      calibration_path.string(), ": the camera's calibration\n");
  return absl::OkStatus();
}

}  // namespace

void AddSimulateCommand(CLI::App& app, Subcommands* all) {
  const auto [command, flags] = all->Add(
      app, "simulate",
      "Writes the events of a simulated event camera as a RAW file, with ground truth", &Simulate);
  command.add_option("source", flags.source, "A simulated event camera, as for --source")
      ->required();
  AddOutputOption(command, &flags.out, &flags.force,
                  "RAW file (EVT 3.0); ground truth is written beside it as .csv, the calibration "
                  "as .yaml")
      ->required();
  command.add_option("--target", flags.target, "The wand and its blink frequency");
  command
      .add_option("--truth-rate", flags.truth_hz,
                  "Rate of ground truth on the sensor's clock, Hz [200]")
      ->check(CLI::Range(1.0, 1e4));
  command.footer(
      "Example:\n"
      "  rigcal-agent simulate 'sim:camera=1;events=1;duration=2;lux=300;bars=4' --output "
      "left.raw\n"
      "Exit codes: 0 ok, 1 failed, 2 usage.");
}

}  // namespace rigcal::agent
